//! Text from elsewhere for a terminal: a file name, a gripper's answer or another node's message must not control it.

use std::borrow::Cow;

/// The text with control characters written out, as `\u{1b}`, except line ends and tabs, and addresses
/// [without their passwords](without_passwords).
pub fn printable(text: &str) -> Cow<'_, str> {
    let commands = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    let text = without_passwords(text);
    if !text.contains(commands) {
        return text;
    }
    let written = |c: char| if commands(c) { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(written).collect())
}

/// The text with every address `SCHEME://USER:PASSWORD@HOST` in it as `SCHEME://USER@HOST`.
pub fn without_passwords(text: &str) -> Cow<'_, str> {
    let mut parts = text.split("://");
    let mut shown = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        shown.push_str("://");
        // As ffmpeg does: the host is behind the last `@`.
        let end = part.find(|c: char| "/?#".contains(c) || c.is_whitespace()).unwrap_or(part.len());
        let login = part[..end].rfind('@').map(|at| &part[..at]);
        let user = login.and_then(|login| login.split_once(':')).map(|(user, _)| user);
        match user.zip(login) {
            Some((user, login)) => shown.extend([user, &part[login.len()..]]),
            None => shown.push_str(part),
        }
    }
    if shown.len() == text.len() { Cow::Borrowed(text) } else { Cow::Owned(shown) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_written_out_and_everything_else_stays() {
        assert_eq!(printable("\u{1b}[2J\r\u{7}\u{9b}x\0"), "\\u{1b}[2J\\r\\u{7}\\u{9b}x\\u{0}");
        for plain in ["an image.png", "two\nlines\tand a tab", "\u{3b1}\u{3b2} \u{4e2d}\u{6587}"] {
            assert_eq!(printable(plain), plain);
        }
    }

    #[test]
    fn an_address_is_told_without_its_password() {
        for (address, told) in [
            ("rtsp://me:secret@10.0.0.7:554/gel?a=b", "rtsp://me@10.0.0.7:554/gel?a=b"),
            ("rtsp://me:se@cr:et@cam", "rtsp://me@cam"),
            ("left, 'https://:secret@cam/a': 401; srt://me:secret@b", "left, 'https://@cam/a': 401; srt://me@b"),
        ] {
            assert_eq!((&*without_passwords(address), &*printable(address)), (told, told));
        }
        for plain in ["rtsp://10.0.0.7:554/gel:a@b", "rtsp://me@cam/a", "udp://host:1 a:b@c", "a:b@c", "a://b://c", ""]
        {
            assert_eq!(without_passwords(plain), plain);
        }
    }
}
