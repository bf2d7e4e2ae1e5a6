//! A line of the doctor's.

/// What was found of one thing.
pub struct Finding {
    /// Of what.
    pub name: &'static str,
    /// What it is.
    pub is: String,
    /// What to do; None when it is good.
    pub advice: Option<String>,
    /// Whether it is to be mended.
    pub is_bad: bool,
}

/// Something that is as it should be.
pub fn good(name: &'static str, is: impl Into<String>) -> Finding {
    Finding { name, is: is.into(), advice: None, is_bad: false }
}

/// Something to be mended.
pub fn bad(name: &'static str, is: impl Into<String>, advice: impl Into<String>) -> Finding {
    Finding { name, is: is.into(), advice: Some(advice.into()), is_bad: true }
}

/// What cannot be seen from here: a person has to look.
pub fn unknown(name: &'static str, is: impl Into<String>, advice: impl Into<String>) -> Finding {
    Finding { is_bad: false, ..bad(name, is, advice) }
}

/// Either.
pub fn judged(name: &'static str, is: String, is_good: bool, advice: &str) -> Finding {
    if is_good { good(name, is) } else { bad(name, is, advice) }
}
