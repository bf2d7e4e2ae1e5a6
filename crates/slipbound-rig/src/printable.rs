//! Text from elsewhere for a terminal: a file name, a gripper's answer or another node's message must not control it.

use std::borrow::Cow;

/// The text with control characters written out, as `\u{1b}`, except line ends and tabs.
pub fn printable(text: &str) -> Cow<'_, str> {
    let commands = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(commands) {
        return Cow::Borrowed(text);
    }
    let written = |c: char| if commands(c) { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(written).collect())
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
}
