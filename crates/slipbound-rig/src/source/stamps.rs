//! Whether the time stamps of a stream's server are trusted.
//!
//! ```text
//!   12.001  12.034  12.068 ..        each is later than the one before it: the time of the frame
//!   12      12      12     13 ..     of a clock without parts of a second  } the time of arrival from then on: frames
//!    0       0       0 ..            of no clock at all                    } of equal times, or of two clocks, could
//!   12.001   --     12.068 ..        of a server that leaves one out        } not be judged
//! ```

/// The stamps of a source, over all its connections.
#[derive(Debug, Default)]
pub(super) struct Stamps {
    /// Stamp of the last frame of this connection, ns.
    last_ns: Option<u64>,
    /// Whether a frame was given the time of its stamp.
    have_been_used: bool,
    are_distrusted: bool,
}

impl Stamps {
    /// A connection begins: its server's clock may restart.
    pub fn connect(&mut self) {
        self.last_ns = None;
    }

    /// The time of the next frame by its server's clock, ns, from its stamp; None without a stamp, and when it is not
    /// trusted.
    pub fn device_ns(&mut self, stamp_ns: Option<u64>) -> Option<u64> {
        let Some(stamp_ns) = stamp_ns.filter(|ns| *ns > 0) else {
            self.are_distrusted |= self.have_been_used;
            return None;
        };
        let last_ns = self.last_ns.replace(stamp_ns);
        self.are_distrusted |= last_ns.is_some_and(|last_ns| stamp_ns <= last_ns);
        self.have_been_used |= !self.are_distrusted;
        (!self.are_distrusted).then_some(stamp_ns)
    }

    /// Whether frames have the times of their stamps.
    pub fn are_used(&self) -> bool {
        self.have_been_used && !self.are_distrusted
    }

    /// Whether a stamp was not later than the one before it, or missing after others: no later stamp of this source is
    /// trusted.
    pub fn are_distrusted(&self) -> bool {
        self.are_distrusted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_believed_until_one_is_missing_or_not_later_than_the_last_of_its_connection() {
        for missing in [None, Some(0)] {
            let mut stamps = Stamps::default();
            assert_eq!([missing, Some(5), Some(6)].map(|ns| stamps.device_ns(ns)), [None, Some(5), Some(6)]);
            stamps.connect();
            assert_eq!([missing, Some(7)].map(|ns| stamps.device_ns(ns)), [None, None], "times of one clock only");
            assert!(stamps.are_distrusted());
        }
        let mut stamps = Stamps::default();
        assert_eq!([Some(1), Some(2), Some(2), Some(3)].map(|ns| stamps.device_ns(ns)), [Some(1), Some(2), None, None]);
        stamps.connect();
        assert_eq!((stamps.device_ns(Some(9)), stamps.are_distrusted()), (None, true));
    }
}
