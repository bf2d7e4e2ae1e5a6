//! Parts out of streams that are whole, damaged and split anywhere.

use super::*;
use proptest::prelude::*;

/// All output for a stream that arrives in pieces of these lengths (the last one again and again), and the most bytes
/// that were kept at a time.
fn parts(boundary: &str, stream: &[u8], pieces: &[usize]) -> (Vec<Vec<u8>>, Result<Found, Fault>, usize) {
    let mut parser = Multipart::new(boundary);
    let (mut found, mut part, mut rest, mut kept_bytes) = (Vec::new(), Vec::new(), stream, 0);
    let mut pieces = pieces.iter().copied().chain(std::iter::repeat(pieces.last().copied().unwrap_or(1)));
    loop {
        let (piece, later) = rest.split_at(pieces.next().unwrap_or(1).clamp(1, rest.len().max(1)).min(rest.len()));
        rest = later;
        parser.push(piece);
        loop {
            match parser.next(&mut part) {
                Ok(Found::Part(_)) => found.push(part.clone()),
                Ok(Found::Nothing) if !rest.is_empty() => break,
                last => return (found, last, kept_bytes),
            }
        }
        kept_bytes = kept_bytes.max(parser.bytes.len());
    }
}

/// A body that begins and ends as a JPEG does.
fn body(fill: u8, count: usize) -> Vec<u8> {
    [&[0xFF, 0xD8][..], &vec![fill; count], &JPEG_END].concat()
}

fn stream(parts: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut out = b"--cam".to_vec();
    for (head, body) in parts {
        out.extend_from_slice(format!("\r\n{head}\r\n\r\n").as_bytes());
        out.extend_from_slice(body);
        out.extend_from_slice(b"\r\n--cam");
    }
    out
}

#[test]
fn parts_with_right_wrong_and_no_lengths_are_all_found() {
    let bodies: Vec<Vec<u8>> = (0..6).map(|i| body(i, 40)).collect();
    let heads = [
        "Content-Length: 44",
        "Content-Length: 20",
        "content-length:99",
        "X: y",
        "Content-Length: ?",
        "Content-Length: 4294967295",
    ];
    let all: Vec<_> = heads.iter().map(|h| h.to_string()).zip(bodies.clone()).collect();
    let mut bytes = stream(&all);
    bytes.extend_from_slice(b"--\r\n");
    assert_eq!(parts("cam", &bytes, &[7]), (bodies, Ok(Found::End), parts("cam", &bytes, &[7]).2));
}

#[test]
fn a_part_whose_own_bytes_spell_the_delimiter_is_whole() {
    let body = [&[0xFF, 0xD8, 7][..], b"--cam", &[9; 20], b"--cam--", &JPEG_END].concat();
    let all =
        vec![(format!("Content-Length: {}", body.len()), body.clone()), ("Content-Length: 999".into(), body.clone())];
    let bytes = [stream(&all), b"--\r\n".to_vec()].concat();
    for piece in [1, 7, bytes.len()] {
        let (found, last, _) = parts("cam", &bytes, &[piece]);
        assert_eq!((found, last), (vec![body.clone(), body.clone()], Ok(Found::End)), "{piece}");
    }
}

#[test]
fn a_part_with_the_right_length_is_given_before_the_next_delimiter_comes() {
    let mut parser = Multipart::new("cam");
    let mut part = Vec::new();
    parser.push(b"--cam\r\nContent-Length: 44\r\nX-Timestamp: 12.000345\r\n\r\n");
    parser.push(&body(1, 40));
    let head = Head { length_bytes: Some(44), time_ns: Some(12_000_345_000) };
    assert_eq!((parser.next(&mut part), &part), (Ok(Found::Part(head)), &body(1, 40)));
    assert_eq!(parser.begun_bytes(), 0);
}

#[test]
fn boundaries_with_dashes_of_their_own_and_bare_line_feeds_are_understood() {
    for (boundary, delimiter, end) in [("--cam", "--cam", "\r\n"), ("--cam", "----cam", "\r\n"), ("cam", "--cam", "\n")]
    {
        let bytes = format!("{delimiter}{end}A: b{end}{end}hello{end}{delimiter}{end}{end}you{end}{delimiter}--");
        let (found, last, _) = parts(boundary, bytes.as_bytes(), &[3]);
        assert_eq!(found, [b"hello".to_vec(), b"you".to_vec()], "{boundary} {delimiter} {end:?}");
        assert_eq!(last, Ok(Found::End));
    }
}

#[test]
fn heads_parts_and_gaps_without_an_end_are_refused_and_little_is_kept() {
    let endless = |start: &[u8], fill: u8, count: usize| [start, &vec![fill; count]].concat();
    let piece = [4096];
    let (_, last, kept_bytes) = parts("cam", &endless(b"--cam\r\nX: ", b'x', 1 << 20), &piece);
    assert_eq!(last, Err(Fault::EndlessHead));
    assert!(kept_bytes <= LONGEST_HEAD_BYTES + 4096, "{kept_bytes}");
    let (_, last, kept_bytes) = parts("cam", &endless(b"", b'-', 4 << 20), &piece);
    assert_eq!(last, Err(Fault::NoDelimiter { name: "cam".into() }));
    assert!(kept_bytes <= 8192, "{kept_bytes}");
    for head in ["", "Content-Length: 99999999999\r\n"] {
        let start = format!("--cam\r\n{head}\r\n");
        let (_, last, kept_bytes) = parts("cam", &endless(start.as_bytes(), 0, 30 << 20), &[1 << 20]);
        assert_eq!(last, Err(Fault::EndlessPart), "{head}");
        assert!(kept_bytes <= LONGEST_PART_BYTES + (2 << 20), "{kept_bytes}");
    }
}

#[test]
fn time_stamps_are_exact_to_the_nanosecond() {
    for (text, ns) in
        [("0", Some(0)), ("3.5", Some(3_500_000_000)), ("1700000000.123456", Some(1_700_000_000_123_456_000))]
    {
        assert_eq!(seconds_to_ns(text), ns, "{text}");
    }
    for text in ["", ".5", "-1", "1e9", "1.2.3", "now", "99999999999999999999"] {
        assert_eq!(seconds_to_ns(text), None, "{text}");
    }
}

/// Streams close to real ones: heads with right, wrong and no lengths, bodies of any bytes, damaged by a few bytes.
fn streams() -> impl Strategy<Value = Vec<u8>> {
    let bytes = proptest::collection::vec(prop_oneof![3 => any::<u8>(), 1 => Just(b'-'), 1 => Just(b'\n')], 0..60);
    let length = prop_oneof![Just(None), (0usize..90).prop_map(Some)];
    let part = (bytes, length, any::<bool>()).prop_map(|(fill, length, is_right)| {
        let body = [&[0xFF, 0xD8][..], &fill, &JPEG_END].concat();
        let length = if is_right { Some(body.len()) } else { length };
        (length.map_or("A: b".into(), |n| format!("Content-Length: {n}")), body)
    });
    let damage = proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4);
    (proptest::collection::vec(part, 1..5), damage).prop_map(|(parts, damage)| {
        let mut bytes = stream(&parts);
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases_count()))]

    #[test]
    fn any_split_of_the_bytes_gives_the_same_parts(
        bytes in streams(),
        pieces in proptest::collection::vec(1usize..40, 1..20),
    ) {
        let (whole, ended, _) = parts("cam", &bytes, &[bytes.len()]);
        let (split, split_ended, _) = parts("cam", &bytes, &pieces);
        prop_assert_eq!((whole, ended), (split, split_ended));
    }

    #[test]
    fn no_bytes_make_it_panic(
        bytes in proptest::collection::vec(prop_oneof![any::<u8>(), Just(b'-'), Just(b'c'), Just(b'\r'), Just(b'\n')], 0..300),
        piece in 1usize..9,
    ) {
        let kept_bytes = parts("c", &bytes, &[piece]).2;
        prop_assert!(kept_bytes <= bytes.len());
    }
}

/// `PROPTEST_CASES`, or 512.
fn cases_count() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(512)
}
