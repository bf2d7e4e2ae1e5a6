//! The lines of the line protocol.

/// Protocol version.
pub const VERSION: u32 = 1;

/// A command without its number: `WORD key value key value`. Numbers have six digits after the point.
pub fn ask(word: &str, pairs: &[(&str, f64)]) -> String {
    let mut line = word.to_owned();
    for (key, value) in pairs {
        line += &format!(" {key} {value:.6}");
    }
    line
}

/// The finite number after a key among `key value key value`.
pub fn number_of(words: &str, key: &str) -> Option<f64> {
    let mut words = words.split_whitespace().skip_while(|word| *word != key);
    words.nth(1)?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// A message of the other side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer<'a> {
    /// Its version.
    Hello(u32),
    /// A command was accepted, as these words.
    Ack {
        /// Number of the command.
        number: u64,
        /// The words that were accepted.
        words: &'a str,
    },
    /// A command was refused.
    Err {
        /// Number of the command.
        number: u64,
        /// Why.
        why: &'a str,
    },
    /// The state of the gripper, as keys and values.
    Gripper(&'a str),
    /// The state of the wrist, as keys and values.
    Wrist(&'a str),
}

impl<'a> Answer<'a> {
    /// Reads a line; None when it is none of these.
    pub fn parse(line: &'a str) -> Option<Self> {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        let numbered = || {
            let (number, rest) = rest.split_once(' ').unwrap_or((rest, ""));
            Some((number.parse().ok()?, rest))
        };
        Some(match word {
            "HELLO" => Answer::Hello(rest.strip_prefix("slipbound-line ")?.parse().ok()?),
            "ACK" => numbered().map(|(number, words)| Answer::Ack { number, words })?,
            "ERR" => numbered().map(|(number, why)| Answer::Err { number, why })?,
            "GRIPPER" => Answer::Gripper(rest),
            "WRIST" => Answer::Wrist(rest),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_and_written_as_described() {
        assert_eq!(ask("GRASP", &[("force_n", 20.0)]), "GRASP force_n 20.000000");
        assert_eq!(Answer::parse("HELLO slipbound-line 1"), Some(Answer::Hello(1)));
        let words = "GRASP force_n 20.000000";
        assert_eq!(Answer::parse("ACK 7 GRASP force_n 20.000000"), Some(Answer::Ack { number: 7, words }));
        assert_eq!(Answer::parse("ERR 7 too much"), Some(Answer::Err { number: 7, why: "too much" }));
        assert_eq!(Answer::parse("ACK 7"), Some(Answer::Ack { number: 7, words: "" }));
        for line in ["", "ACK", "ACK x y", "HELLO world 1", "banana 3"] {
            assert_eq!(Answer::parse(line), None, "{line}");
        }
        let state = "jaws holding force_n 19.8 opening_mm nan";
        assert_eq!((number_of(state, "force_n"), number_of(state, "opening_mm")), (Some(19.8), None));
        assert_eq!((number_of(state, "target_n"), number_of("force_n", "force_n")), (None, None));
    }
}
