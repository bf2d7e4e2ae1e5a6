//! The order people number files in: `frame9` before `frame10`.

use std::cmp::Ordering;

/// Compares names with runs of digits taken as numbers, however long; equal ones by their characters (`1` before `01`).
pub(super) fn compare(a: &str, b: &str) -> Ordering {
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
    use super::compare;

    #[test]
    fn numbers_count_as_numbers() {
        let mut names = ["b1", "a10", "a9", "a09", "a", "a10b2", "a10b10", "a99999999999999999999999", "ä2", "ä10"];
        names.sort_by(|a, b| compare(a, b));
        assert_eq!(names, ["a", "a9", "a09", "a10", "a10b2", "a10b10", "a99999999999999999999999", "b1", "ä2", "ä10"]);
    }
}
