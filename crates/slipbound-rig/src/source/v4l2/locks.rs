//! Locks exposure, gain, white balance and focus: an automatic change of brightness looks like a contact, and one of
//! focus moves every marker.

use super::options::{LOCKS, Lock};
use super::sys::Device;

/// The controls behind one of [`LOCKS`]: the switch to automatic with its value for manual, and the value itself.
struct Controls {
    switch: u32,
    manual: i32,
    value: u32,
}

/// In the order of [`LOCKS`]; the numbers are those of `linux/v4l2-controls.h`.
const CONTROLS: [Controls; 4] = [
    Controls { switch: 0x009a_0901, manual: 1, value: 0x009a_0902 },
    Controls { switch: 0x0098_0912, manual: 0, value: 0x0098_0913 },
    Controls { switch: 0x0098_090c, manual: 0, value: 0x0098_091a },
    Controls { switch: 0x009a_090c, manual: 0, value: 0x009a_090a },
];

/// Lets exposure lower the frame rate (`V4L2_CID_EXPOSURE_AUTO_PRIORITY`).
const EXPOSURE_BEFORE_RATE: u32 = 0x009a_0903;

/// Whether the camera changes something automatically, so that it must be given time to settle.
pub fn can_change(device: &Device) -> bool {
    CONTROLS.iter().any(|controls| device.control(controls.switch).is_ok_and(|value| value != controls.manual))
}

/// Facts of a camera, as names and values.
pub type Facts = Vec<(String, String)>;

/// Locks the requested controls; returns their locked values in words and as values, None for those not locked. Fails
/// for a value that the camera does not have.
pub fn lock(device: &Device, locks: &[Lock; 4]) -> Result<(Facts, [Option<i32>; 4]), String> {
    if device.control_range(EXPOSURE_BEFORE_RATE).is_some() {
        // A camera that refuses only runs slower in the dark, which its rate shows.
        let _ = device.set_control(EXPOSURE_BEFORE_RATE, 0);
    }
    let (mut facts, mut values) = (Vec::new(), [None; 4]);
    for (((name, controls), lock), value) in LOCKS.iter().zip(&CONTROLS).zip(locks).zip(&mut values) {
        let (words, locked) = lock_one(device, name, controls, *lock)?;
        facts.push(((*name).to_owned(), words));
        *value = locked;
    }
    Ok((facts, values))
}

fn lock_one(device: &Device, name: &str, controls: &Controls, lock: Lock) -> Result<(String, Option<i32>), String> {
    let range = device.control_range(controls.value);
    if lock == Lock::Auto {
        return Ok(("left to the camera".into(), None));
    }
    if device.control_range(controls.switch).is_some() {
        let set = device.set_control(controls.switch, controls.manual);
        // Some cameras have a switch without a manual setting; a value given to them must still be accepted.
        if let (Err(e), Lock::Here | Lock::Again(_)) = (set, lock) {
            return Ok((format!("not locked: the camera refuses ({e})"), None));
        }
    }
    match (lock, range) {
        (Lock::At(value), None) => Err(format!("a camera whose {name} can be set to {value}, got one without it")),
        (Lock::At(value), Some(range)) if !(range.least..=range.most).contains(&value) => {
            Err(format!("{name}={} to {}, got {value}", range.least, range.most))
        }
        (Lock::At(value), Some(_)) => {
            device
                .set_control(controls.value, value)
                .map_err(|e| format!("a camera that takes {name}={value}: {e}"))?;
            Ok(locked(device, controls))
        }
        (Lock::Again(value), Some(_)) => {
            // If refused, it is locked at its present value and reported as a difference: a camera that is back is
            // better than none.
            let _ = device.set_control(controls.value, value);
            Ok(locked(device, controls))
        }
        (_, Some(_)) => Ok(locked(device, controls)),
        (_, None) => Ok(("the camera has none".into(), None)),
    }
}

fn locked(device: &Device, controls: &Controls) -> (String, Option<i32>) {
    match device.control(controls.value) {
        Ok(value) => (format!("locked at {value}"), Some(value)),
        Err(_) => ("locked".into(), None),
    }
}
