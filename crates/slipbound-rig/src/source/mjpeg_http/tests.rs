//! Addresses, requests and answers, without a connection.

use super::*;

#[test]
fn addresses_are_taken_apart_and_wrong_ones_refused_in_words() {
    let of = |host: &str, port, path: &str| Ok(Address { host: host.into(), port, path: path.into() });
    assert_eq!(Address::parse("http://pi:8080/stream.mjpg"), of("pi", 8080, "/stream.mjpg"));
    assert_eq!(Address::parse("http://10.0.0.7"), of("10.0.0.7", 80, "/"));
    assert_eq!(Address::parse("http://[::1]:81?action=stream"), of("::1", 81, "/?action=stream"));
    assert_eq!(Address::parse("http://[::1]/a"), of("::1", 80, "/a"));
    for (url, expected) in [
        ("http://", "http://HOST"),
        ("http://:80/", "http://HOST"),
        ("http://a:0/", "http://HOST"),
        ("http://a:x/", "a port"),
        ("http://me:secret@a/", "without a user"),
        ("http://a/b c", "without blanks"),
    ] {
        assert!(Address::parse(url).expect_err(url).contains(expected), "{url}");
    }
}

#[test]
fn the_request_names_the_host_as_the_address_does() {
    for (url, host) in
        [("http://pi:8080/a", "pi:8080"), ("http://[::1]:81/a", "[::1]:81"), ("http://[::1]", "[::1]:80")]
    {
        let request = Address::parse(url).expect("an address").request();
        assert!(request.contains(&format!("\r\nHost: {host}\r\n")), "{request}");
    }
}

#[test]
fn an_answer_that_is_no_stream_is_refused_with_what_it_is() {
    let head = |status: &str, kind: &str| boundary(&format!("HTTP/1.0 {status}\r\nContent-Type: {kind}\r\n\r\n"));
    assert_eq!(head("200 OK", "multipart/x-mixed-replace; boundary=\"a b\""), Ok("a b".into()));
    assert_eq!(head("200 OK", "Multipart/X-Mixed-Replace;Boundary=--Cam;x=y"), Ok("--Cam".into()));
    for (status, kind, expected) in [
        ("404 Not Found", "text/html", "404 Not Found"),
        ("401 Unauthorized", "text/html", "password"),
        ("302 Found\r\nLocation: http://b/c", "text/html", "try http://b/c"),
        ("200 OK", "image/jpeg", "single picture"),
        ("200 OK", "multipart/x-mixed-replace", "a boundary"),
    ] {
        let refused = head(status, kind).expect_err(status);
        assert!(refused.contains(expected), "{refused}");
    }
}
