//! A line of the doctor's output.

/// The finding on one thing.
pub struct Finding {
    /// Its subject.
    pub name: &'static str,
    /// Its state.
    pub is: String,
    /// What to do; None when it is good.
    pub advice: Option<String>,
    /// Whether it needs to be fixed.
    pub is_bad: bool,
}

/// A finding that is good.
pub fn good(name: &'static str, is: impl Into<String>) -> Finding {
    Finding { name, is: is.into(), advice: None, is_bad: false }
}

/// A finding that needs to be fixed.
pub fn bad(name: &'static str, is: impl Into<String>, advice: impl Into<String>) -> Finding {
    Finding { name, is: is.into(), advice: Some(advice.into()), is_bad: true }
}

/// A finding that only a person can check.
pub fn unknown(name: &'static str, is: impl Into<String>, advice: impl Into<String>) -> Finding {
    Finding { is_bad: false, ..bad(name, is, advice) }
}

/// A good finding or a bad one.
pub fn judged(name: &'static str, is: String, is_good: bool, advice: &str) -> Finding {
    if is_good { good(name, is) } else { bad(name, is, advice) }
}
