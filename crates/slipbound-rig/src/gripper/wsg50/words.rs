//! What the WSG-50's numbers mean.

/// Why a fast stop is latched when a link of ours has ended before.
pub(crate) const LINK_CUT: &str =
    "our last link to it was cut without a farewell, as by a pulled cable or a killed program";

/// Commands.
pub mod id {
    #![allow(missing_docs)]
    pub const DISCONNECT: u8 = 0x07;
    pub const HOME: u8 = 0x20;
    pub const MOVE: u8 = 0x21;
    pub const STOP: u8 = 0x22;
    pub const FAST_STOP: u8 = 0x23;
    pub const ACKNOWLEDGE: u8 = 0x24;
    pub const GRASP: u8 = 0x25;
    pub const RELEASE: u8 = 0x26;
    pub const SET_ACCELERATION: u8 = 0x30;
    pub const GET_ACCELERATION: u8 = 0x31;
    pub const SET_LIMIT: u8 = 0x32;
    pub const GET_LIMIT: u8 = 0x33;
    pub const TARE: u8 = 0x38;
    pub const SYSTEM_STATE: u8 = 0x40;
    pub const GRASP_STATE: u8 = 0x41;
    pub const OPENING: u8 = 0x43;
    pub const SPEED: u8 = 0x44;
    pub const FORCE: u8 = 0x45;
}

/// Answers to commands.
pub mod status {
    #![allow(missing_docs)]
    pub const OK: u16 = 0;
    pub const NOT_INITIALIZED: u16 = 3;
    pub const ALREADY_RUNNING: u16 = 4;
    pub const TOO_SHORT: u16 = 13;
    pub const UNKNOWN: u16 = 14;
    pub const FORMAT: u16 = 15;
    pub const DENIED: u16 = 16;
    pub const FAILED: u16 = 18;
    pub const ABORTED: u16 = 19;
    pub const PENDING: u16 = 26;
    pub const RANGE: u16 = 28;
    pub const BLOCKED: u16 = 29;

    /// The names by which the text interface may call them, from 0 on.
    const NAMES: [&str; 31] = [
        "SUCCESS",
        "NOT_AVAILABLE",
        "NO_SENSOR",
        "NOT_INITIALIZED",
        "ALREADY_RUNNING",
        "FEATURE_NOT_SUPPORTED",
        "INCONSISTENT_DATA",
        "TIMEOUT",
        "READ_ERROR",
        "WRITE_ERROR",
        "INSUFFICIENT_RESOURCES",
        "CHECKSUM_ERROR",
        "NO_PARAM_EXPECTED",
        "NOT_ENOUGH_PARAMS",
        "CMD_UNKNOWN",
        "CMD_FORMAT_ERROR",
        "ACCESS_DENIED",
        "ALREADY_OPEN",
        "CMD_FAILED",
        "CMD_ABORTED",
        "INVALID_HANDLE",
        "NOT_FOUND",
        "NOT_OPEN",
        "IO_ERROR",
        "INVALID_PARAMETER",
        "INDEX_OUT_OF_BOUNDS",
        "CMD_PENDING",
        "OVERRUN",
        "RANGE_ERROR",
        "AXIS_BLOCKED",
        "FILE_EXISTS",
    ];

    /// The name of a status.
    pub fn name(code: u16) -> Option<&'static str> {
        NAMES.get(usize::from(code)).copied()
    }

    /// A status as a number or by its name; the largest number where it is neither.
    pub fn read(text: &str) -> u16 {
        let name = text.strip_prefix("E_").unwrap_or(text);
        let named = || NAMES.iter().position(|known| *known == name).and_then(|code| u16::try_from(code).ok());
        text.parse().ok().or_else(named).unwrap_or(u16::MAX)
    }

    /// The answer of the text interface, in words; an unknown status as it came.
    pub fn answered(text: &str) -> String {
        match read(text) {
            u16::MAX => format!("{text:?}"),
            code => in_words(code),
        }
    }

    /// The status in words.
    pub fn in_words(status: u16) -> String {
        let words = match status {
            OK => "done",
            NOT_INITIALIZED => "not homed",
            ALREADY_RUNNING => "another motion is under way",
            TOO_SHORT => "too few parameters",
            UNKNOWN => "unknown command",
            FORMAT => "wrong format",
            DENIED => "access denied: fast stop, or not in this state",
            FAILED => "command failed",
            ABORTED => "aborted",
            PENDING => "under way",
            RANGE => "out of range",
            BLOCKED => "axis blocked: contact where none was expected; is part_width_mm right?",
            _ => "",
        };
        match words {
            "" => format!("status {status}"),
            words => format!("status {status}, {words}"),
        }
    }
}

/// What the jaws are doing with a part.
pub mod grasp {
    #![allow(missing_docs)]

    use slipbound::port::Jaws;

    pub const IDLE: u8 = 0;
    pub const GRASPING: u8 = 1;
    pub const NO_PART: u8 = 2;
    pub const PART_LOST: u8 = 3;
    pub const HOLDING: u8 = 4;
    pub const RELEASING: u8 = 5;
    pub const POSITIONING: u8 = 6;
    pub const ERROR: u8 = 7;

    /// The same for a caller; None: not received yet.
    pub(crate) fn jaws(grasp: Option<u8>) -> Jaws {
        match grasp {
            Some(GRASPING) => Jaws::Closing,
            Some(NO_PART) => Jaws::Nothing,
            Some(PART_LOST) => Jaws::Lost,
            Some(HOLDING) => Jaws::Holding,
            Some(IDLE | RELEASING | POSITIONING) => Jaws::Open,
            _ => Jaws::Unknown,
        }
    }
}

/// Bits of the system state.
pub mod flag {
    #![allow(missing_docs)]
    pub const REFERENCED: u32 = 1;
    pub const MOVING: u32 = 1 << 1;
    pub const BLOCKED_MINUS: u32 = 1 << 2;
    pub const AXIS_STOPPED: u32 = 1 << 6;
    pub const TARGET_POS_REACHED: u32 = 1 << 7;
    pub const FAST_STOP: u32 = 1 << 12;
    pub const TEMPERATURE_FAULT: u32 = 1 << 14;
    pub const POWER_FAULT: u32 = 1 << 15;
    pub const CURRENT_FAULT: u32 = 1 << 16;
    pub const FINGER_FAULT: u32 = 1 << 17;

    const FAULTS: [(u32, &str); 4] = [
        (TEMPERATURE_FAULT, "it is too hot"),
        (POWER_FAULT, "its supply voltage is wrong"),
        (CURRENT_FAULT, "its motor draws too much current"),
        (FINGER_FAULT, "a sensor finger fails"),
    ];

    /// The faults of the hardware among these bits, in words; empty when there is none.
    pub fn faults(system: u32) -> String {
        let words: Vec<&str> = FAULTS.iter().filter(|(bit, _)| system & bit != 0).map(|(_, words)| *words).collect();
        words.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::flag::faults;

    #[test]
    fn a_fault_is_told_by_its_bit_of_the_system_state() {
        for (bit, words) in [(14, "too hot"), (15, "supply voltage"), (16, "too much current"), (17, "sensor finger")] {
            assert!(faults(1 << bit).contains(words), "bit {bit}: {:?}", faults(1 << bit));
        }
        assert_eq!(faults(!(0xf << 14)), "", "the other bits are no faults");
        assert_eq!(faults(0xf << 14).matches(", ").count(), 3, "all of them are told");
    }
}
