//! A message on its way to its first answer.

/// A message that was sent and not yet answered.
#[derive(Debug, Clone)]
pub(crate) struct InFlight<T> {
    /// What was sent.
    pub message: T,
    /// How often it was sent.
    pub sent_count: u32,
    since_ns: u64,
}

impl<T> InFlight<T> {
    /// A message sent now for the first time.
    pub fn new(now_ns: u64, message: T) -> Self {
        InFlight { message, sent_count: 1, since_ns: now_ns }
    }

    /// How long it has been on its way, ns.
    pub fn age_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.since_ns)
    }

    /// The same message, sent now once more.
    pub fn again(self, now_ns: u64) -> Self {
        InFlight { sent_count: self.sent_count + 1, since_ns: now_ns, ..self }
    }

    /// Takes out a message that has waited for its answer longer than this.
    pub fn take_overdue(slot: &mut Option<Self>, now_ns: u64, reply_ms: u64) -> Option<Self> {
        slot.take_if(|sent| now_ns.saturating_sub(sent.since_ns) > reply_ms * 1_000_000)
    }
}
