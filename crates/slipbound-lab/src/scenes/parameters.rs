//! The values of a scene's parameters.

use super::keys::{Key, Value};
use crate::faults::Faults;
use crate::objects::Object;
use slipbound::setting::SettingError;
use std::collections::BTreeMap;

/// A value for every key that a scene takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The scene's name, for messages.
    scene: &'static str,
    values: BTreeMap<&'static str, Value>,
}

impl Parameters {
    pub(super) fn new(scene: &'static str, values: BTreeMap<&'static str, Value>) -> Self {
        Parameters { scene, values }
    }

    /// Another value of a key that the scene uses. Refuses values out of range.
    pub(super) fn set(&mut self, key: &'static Key, text: &str) -> Result<(), SettingError> {
        self.values.insert(key.name, key.read(text)?);
        Ok(())
    }

    /// All keys and values, in the order of the keys' names.
    pub fn values(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.values.iter().map(|(key, value)| (*key, value))
    }

    /// The number of a key. Panics if the scene does not use it, like a slice index.
    pub fn number(&self, key: &str) -> f64 {
        match self.values.get(key) {
            Some(Value::Number(number)) => *number,
            other => panic!("{}: {key} is {other:?}", self.scene),
        }
    }

    /// The word of a key. Panics if the scene does not use it.
    pub fn word(&self, key: &str) -> &str {
        match self.values.get(key) {
            Some(Value::Word(word)) => word,
            other => panic!("{}: {key} is {other:?}", self.scene),
        }
    }

    /// The held object.
    pub fn object(&self) -> &'static Object {
        Object::named(self.word("object")).expect("the name was looked up when it was set")
    }

    /// The friction coefficient: the value set, or the object's.
    pub fn mu(&self) -> f64 {
        match self.values["mu"] {
            Value::Number(mu) => mu,
            Value::Word(_) => self.object().mu,
        }
    }

    /// The faults; None without faults.
    pub fn faults(&self) -> Option<Faults> {
        let text = self.word("fault");
        (text != "none").then(|| Faults::parse(text).expect("the text was read when it was set"))
    }
}
