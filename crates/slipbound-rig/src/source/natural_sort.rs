//! The order people number files in: `frame9` before `frame10`; and, where names are times in seconds, `1.05` before
//! `1.5`.

use std::cmp::Ordering;
use std::path::PathBuf;

/// Digits of the fractions that programs write without their last zeros: fewer are versions (`1.9`, `1.10`), more are
/// nanoseconds.
const FRACTION_DIGITS: std::ops::RangeInclusive<usize> = 4..=7;

/// Sorts files by name.
pub(super) fn sort(files: &mut [PathBuf]) {
    let are_times = are_times(files);
    files.sort_by(|a, b| match are_times {
        true => seconds(a).cmp(&seconds(b)),
        false => compare(&a.to_string_lossy(), &b.to_string_lossy()),
    });
}

/// Whether all names are decimal numbers whose fractions differ in length because last zeros are left out.
fn are_times(files: &[PathBuf]) -> bool {
    let fractions: Option<Vec<String>> = files.iter().map(|file| Some(seconds(file)?.1)).collect();
    let Some(fractions) = fractions else { return false };
    let lengths = || fractions.iter().map(String::len);
    let (Some(least), Some(most)) = (lengths().min(), lengths().max()) else { return false };
    let any = |is: fn(&str) -> bool| fractions.iter().any(|fraction| fraction.len() > 1 && is(fraction));
    // A counter passes ten and a hundred.
    let leaves_zeros_out = !any(|fraction| fraction.ends_with('0'));
    least < most && leaves_zeros_out && (any(|fraction| fraction.starts_with('0')) || FRACTION_DIGITS.contains(&most))
}

/// The whole seconds and the fraction's digits of a name like `1700000000.25.png`; None for any other.
fn seconds(file: &std::path::Path) -> Option<(u64, String)> {
    let stem = file.file_stem()?.to_str()?;
    let (whole, fraction) = stem.split_once('.')?;
    let is_number = |digits: &str| !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    let whole = whole.parse().ok().filter(|_| is_number(whole))?;
    is_number(fraction).then(|| (whole, fraction.to_owned()))
}

/// Compares names with runs of digits taken as numbers, however long; equal ones by their characters (`1` before `01`).
fn compare(a: &str, b: &str) -> Ordering {
    let (mut rest_a, mut rest_b) = (a, b);
    while !rest_a.is_empty() && !rest_b.is_empty() {
        let (head_a, tail_a) = head(rest_a);
        let (head_b, tail_b) = head(rest_b);
        let order = match (head_a.as_bytes()[0].is_ascii_digit(), head_b.as_bytes()[0].is_ascii_digit()) {
            (true, true) => {
                let (a, b) = (head_a.trim_start_matches('0'), head_b.trim_start_matches('0'));
                a.len().cmp(&b.len()).then_with(|| a.cmp(b))
            }
            _ => head_a.cmp(head_b),
        };
        if order.is_ne() {
            return order;
        }
        (rest_a, rest_b) = (tail_a, tail_b);
    }
    rest_a.len().cmp(&rest_b.len()).then_with(|| a.len().cmp(&b.len())).then_with(|| a.cmp(b))
}

/// Splits off a run of digits, or a single other character.
fn head(s: &str) -> (&str, &str) {
    let digits = s.bytes().take_while(u8::is_ascii_digit).count();
    s.split_at(if digits > 0 { digits } else { s.chars().next().map_or(0, char::len_utf8) })
}

#[cfg(test)]
mod tests {
    use super::{compare, sort};
    use std::path::PathBuf;

    fn sorted(stems: &[&str]) -> Vec<String> {
        let mut files: Vec<PathBuf> = stems.iter().map(|stem| format!("run.d/{stem}.png").into()).collect();
        sort(&mut files);
        files.iter().map(|file| file.file_stem().expect("named").to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn times_in_seconds_are_decimal_numbers() {
        assert_eq!(
            sorted(&["10.05", "9.95", "10.1", "10.0667", "10.15"]),
            ["9.95", "10.05", "10.0667", "10.1", "10.15"]
        );
        let of_python = ["1700000000.6666669", "1700000000.7", "1700000000.6333332", "1700000000.65"];
        let expected = ["1700000000.6333332", "1700000000.65", "1700000000.6666669", "1700000000.7"];
        assert_eq!(sorted(&of_python), expected);
        assert_eq!(sorted(&["1.10", "1.9"]), ["1.9", "1.10"], "numbered within a take");
        assert_eq!(sorted(&["1.100", "1.09", "1.10", "1.99"]), ["1.09", "1.10", "1.99", "1.100"], "likewise");
        assert_eq!(sorted(&["1.1000", "1.2", "1.10", "1.1"]), ["1.1", "1.2", "1.10", "1.1000"], "likewise");
        let of_ros = ["7.999999000", "8.5", "8.33333333"];
        assert_eq!(sorted(&of_ros), ["7.999999000", "8.5", "8.33333333"], "nanoseconds without zeros before them");
        assert_eq!(sorted(&["1.05", "1.1", "a1.2"]), ["1.1", "1.05", "a1.2"], "not all are times");
    }

    #[test]
    fn numbers_count_as_numbers() {
        let mut names = ["b1", "a10", "a9", "a09", "a", "a10b2", "a10b10", "a99999999999999999999999", "ä2", "ä10"];
        names.sort_by(|a, b| compare(a, b));
        assert_eq!(names, ["a", "a9", "a09", "a10", "a10b2", "a10b10", "a99999999999999999999999", "b1", "ä2", "ä10"]);
    }
}
