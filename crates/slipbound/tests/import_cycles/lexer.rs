//! Rust source -> words, `::` and signs; skips comments, strings, characters, lifetimes and numbers.

/// A token that is relevant for paths.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Token {
    Word(String),
    /// `::`
    Into,
    Sign(char),
}

/// The tokens of a source text.
pub fn lex(text: &str) -> Vec<Token> {
    let c: Vec<char> = text.chars().collect();
    let at = |i: usize| c.get(i).copied().unwrap_or('\0');
    let (mut tokens, mut i) = (Vec::new(), 0);
    while i < c.len() {
        match c[i] {
            '/' if at(i + 1) == '/' => i = (i..c.len()).find(|&j| c[j] == '\n').unwrap_or(c.len()),
            '/' if at(i + 1) == '*' => i = after_block_comment(&c, i),
            '"' => i = after_text(&c, i),
            '\'' => i = after_quote(&c, i),
            ':' if at(i + 1) == ':' => {
                tokens.push(Token::Into);
                i += 2;
            }
            v if v.is_alphabetic() || v == '_' => {
                let end = end_of_word(&c, i);
                let word: String = c[i..end].iter().collect();
                i = match (word.as_str(), at(end)) {
                    ("r" | "br" | "cr", '"' | '#') if raw_text(&c, end).is_some() => raw_text(&c, end).unwrap_or(end),
                    ("b" | "c", '"') => after_text(&c, end),
                    ("b", '\'') => after_quote(&c, end),
                    _ => {
                        tokens.push(Token::Word(word));
                        end
                    }
                };
            }
            v if v.is_ascii_digit() => i = end_of_word(&c, i),
            v => {
                if !v.is_whitespace() {
                    tokens.push(Token::Sign(v));
                }
                i += 1;
            }
        }
    }
    tokens
}

fn end_of_word(c: &[char], from: usize) -> usize {
    (from..c.len()).find(|&j| !(c[j].is_alphanumeric() || c[j] == '_')).unwrap_or(c.len())
}

fn after_block_comment(c: &[char], from: usize) -> usize {
    let (mut depth, mut i) = (0, from);
    while i < c.len() {
        match (c[i], c.get(i + 1)) {
            ('/', Some('*')) => (depth, i) = (depth + 1, i + 2),
            ('*', Some('/')) => {
                (depth, i) = (depth - 1, i + 2);
                if depth == 0 {
                    return i;
                }
            }
            _ => i += 1,
        }
    }
    i
}

/// The position after the string that begins with the quotation mark at `from`.
fn after_text(c: &[char], from: usize) -> usize {
    let mut i = from + 1;
    while i < c.len() && c[i] != '"' {
        i += if c[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

/// The position after the raw string whose `#` or quotation mark is at `from`; None for a raw identifier.
fn raw_text(c: &[char], from: usize) -> Option<usize> {
    let hashes = c[from..].iter().take_while(|v| **v == '#').count();
    let closed = |i: &usize| c[*i] == '"' && c[i + 1..].iter().take(hashes).filter(|v| **v == '#').count() == hashes;
    (c.get(from + hashes) == Some(&'"'))
        .then(|| (from + hashes + 1..c.len()).find(closed).map_or(c.len(), |i| i + 1 + hashes))
}

/// The position after a character or a lifetime.
fn after_quote(c: &[char], from: usize) -> usize {
    if c.get(from + 1) == Some(&'\\') {
        return (from + 3..c.len()).find(|&j| c[j] == '\'').map_or(c.len(), |j| j + 1);
    }
    if c.get(from + 2) == Some(&'\'') { from + 3 } else { end_of_word(c, from + 1) }
}
