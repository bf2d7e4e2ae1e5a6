//! A line of the doctor's.

/// What was found of one thing.
pub struct Finding {
    /// Of what.
    pub name: &'static str,
    /// What it is.
    pub is: String,
    /// What to do; None when it is good.
    pub advice: Option<String>,
}

/// Something that is as it should be.
pub fn good(name: &'static str, is: impl Into<String>) -> Finding {
    Finding { name, is: is.into(), advice: None }
}

/// Something to be mended.
pub fn bad(name: &'static str, is: impl Into<String>, advice: impl Into<String>) -> Finding {
    Finding { name, is: is.into(), advice: Some(advice.into()) }
}

/// Either.
pub fn judged(name: &'static str, is: String, is_good: bool, advice: &str) -> Finding {
    if is_good { good(name, is) } else { bad(name, is, advice) }
}
