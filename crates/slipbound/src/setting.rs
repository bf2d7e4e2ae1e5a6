//! The error for an invalid setting: the key, the value found, the values allowed. Returned by every `check` and `new`
//! of the crate.

use std::fmt;

/// An invalid setting, or an invalid fact of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingError {
    /// The key, dotted as in its TOML file.
    pub key: String,
    /// The value found.
    pub got: String,
    /// The values allowed.
    pub expected: String,
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: expected {}, got {}", self.key, self.expected, self.got)
    }
}

impl std::error::Error for SettingError {}

impl SettingError {
    /// The error for a name that is not among those allowed; suggests the one that was probably meant.
    pub fn none_of(key: &str, got: &str, names: &[&str]) -> Self {
        let meant = nearest(got, names).map_or_else(String::new, |name| format!(" (did you mean {name}?)"));
        SettingError { key: key.into(), got: format!("{got}{meant}"), expected: format!("one of {}", names.join(", ")) }
    }
}

/// The name that was probably meant: the one with the fewest edits, at most half the length of the word.
pub fn nearest<'a>(word: &str, names: &[&'a str]) -> Option<&'a str> {
    let best = names.iter().min_by_key(|name| edits(word, name))?;
    (2 * edits(word, best) <= word.chars().count()).then_some(*best)
}

/// Number of insertions, deletions and replacements that turn one word into the other.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, sign) in a.chars().enumerate() {
        let mut before = std::mem::replace(&mut row[0], i + 1);
        for j in 0..b.len() {
            let replaced = before + usize::from(b[j] != sign);
            before = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(before + 1);
        }
    }
    row[b.len()]
}

/// Rejects a number outside `low..=high`, or NaN.
pub(crate) fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), SettingError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(SettingError { key: key.into(), got: value.to_string(), expected: format!("a number from {low} to {high}") })
}

/// The names of a kind: `NAMES`, `Display` and `FromStr`, from a table of variants and names.
macro_rules! named {
    ($kind:ty, $key:literal, $table:ident) => {
        impl $kind {
            /// Every name, in the order of the variants.
            pub const NAMES: [&'static str; $table.len()] = {
                let mut names = [""; $table.len()];
                let mut i = 0;
                while i < names.len() {
                    names[i] = $table[i].1;
                    i += 1;
                }
                names
            };

            /// Its name, as in files and on the command line.
            pub fn name(self) -> &'static str {
                $table.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $kind {
            type Err = $crate::setting::SettingError;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                let found = $table.iter().find(|(_, name)| *name == text);
                found
                    .map(|(kind, _)| *kind)
                    .ok_or_else(|| $crate::setting::SettingError::none_of($key, text, &Self::NAMES))
            }
        }
    };
}
pub(crate) use named;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_pen_is_named_and_a_wild_word_is_not() {
        let names = ["ramp", "roll", "press_release"];
        let error = SettingError::none_of("scene", "rmp", &names).to_string();
        assert_eq!(error, "scene: expected one of ramp, roll, press_release, got rmp (did you mean ramp?)");
        assert_eq!((edits("", "abc"), edits("pitch", "pich"), edits("abc", "abc"), edits("ab", "ba")), (3, 1, 0, 2));
        assert_eq!(nearest("pres_relase", &names), Some("press_release"));
        assert_eq!((nearest("zzzz", &names), nearest("", &names), nearest("x", &[])), (None, None, None));
    }
}
