//! Cameras and serial lines of this computer, and the supported grippers.

mod camera_node;

pub use camera_node::CameraNode;

use std::fs;
use std::path::{Path, PathBuf};

/// Every gripper with a driver, and the form of its address.
pub const GRIPPERS: [(&str, &str); 6] = [
    ("Weiss WSG 50, binary protocol", "wsg50://HOST:1000"),
    ("Weiss WSG 50, text protocol", "gcl://HOST:1000"),
    ("Robotiq 2F-85 behind a UR controller", "robotiq://HOST:63352"),
    ("Robotiq 2F-85 on a serial line", "robotiq:///dev/serial/by-id/NAME"),
    ("a gripper that speaks the line protocol", "line://HOST:PORT"),
    ("none", "dry"),
];

/// Where the kernel lists terminals.
const LIST: &str = "/sys/class/tty";
/// Levels above a terminal at which its USB device is searched.
const LEVELS_MOST: usize = 6;

/// Every camera that streams images, by number, and those that cannot be opened, with the reason; none where there is
/// no Video4Linux2.
pub fn cameras() -> (Vec<CameraNode>, Vec<String>) {
    #[cfg(all(feature = "v4l2", target_os = "linux", target_pointer_width = "64"))]
    let found = crate::source::v4l2::cameras();
    #[cfg(not(all(feature = "v4l2", target_os = "linux", target_pointer_width = "64")))]
    let found = (Vec::new(), Vec::new());
    found
}

/// A serial line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialLine {
    /// Its device: the persistent name under `/dev/serial/by-id`, where there is one.
    pub path: PathBuf,
    /// The adapter's product name; None if it is not a USB adapter.
    pub product: Option<String>,
    /// The adapter's serial number.
    pub serial: Option<String>,
    /// Vendor and product of the adapter, four hexadecimal digits each.
    pub usb_id: Option<(String, String)>,
}

impl SerialLine {
    /// Product and serial number.
    pub fn described(&self) -> String {
        let product = self.product.as_deref().unwrap_or("serial line");
        self.serial.as_ref().map_or(product.to_owned(), |serial| format!("{product} serial {serial}"))
    }

    /// A gripper that may be at the other end: its name and address. Robotiq grippers come with an RS-485 adapter;
    /// nothing is sent to check.
    pub fn gripper(&self) -> Option<(&'static str, String)> {
        let is_rs485 = self.product.as_ref().is_some_and(|product| product.to_uppercase().contains("RS485"));
        is_rs485.then(|| ("perhaps a Robotiq 2F-85", format!("robotiq://{}", self.path.display())))
    }
}

/// The serial lines that belong to a device: USB adapters, and the ports on the board that exist.
pub fn serial_lines() -> Vec<SerialLine> {
    let Ok(list) = fs::read_dir(LIST) else { return Vec::new() };
    let mut names: Vec<String> = list.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| is_line(&Path::new(LIST).join(name)));
    names.sort_by_key(|name| (name.len(), name.clone()));
    names.iter().map(|name| look(name)).collect()
}

/// Whether a listed terminal is a serial line with hardware behind it. The kernel lists ports that a PC may have; those
/// that it has not are of type 0.
fn is_line(listed: &Path) -> bool {
    let is_serial = listed.file_name().is_some_and(|name| name.to_string_lossy().starts_with("tty"));
    let is_absent = fs::read_to_string(listed.join("type")).is_ok_and(|kind| kind.trim() == "0");
    is_serial && listed.join("device").exists() && !is_absent
}

fn look(name: &str) -> SerialLine {
    let read = |path: PathBuf| fs::read_to_string(path).ok().map(|text| text.trim().to_owned());
    let start = fs::canonicalize(Path::new(LIST).join(name).join("device")).unwrap_or_default();
    let usb = start.ancestors().take(LEVELS_MOST).find(|folder| folder.join("idVendor").exists());
    let fact = |file: &str| usb.and_then(|folder| read(folder.join(file)));
    SerialLine {
        path: lasting_name(&Path::new("/dev").join(name)),
        product: fact("product"),
        serial: fact("serial"),
        usb_id: fact("idVendor").zip(fact("idProduct")),
    }
}

/// The link under `/dev/serial/by-id` to a device, or the device.
fn lasting_name(device: &Path) -> PathBuf {
    let links = fs::read_dir("/dev/serial/by-id").into_iter().flatten().flatten();
    let link = links.map(|entry| entry.path()).find(|link| fs::canonicalize(link).is_ok_and(|to| to == device));
    link.unwrap_or_else(|| device.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_rs485_adapter_may_have_a_gripper_behind_it() {
        let line = |product: &str| SerialLine {
            path: "/dev/ttyUSB0".into(),
            product: Some(product.into()),
            serial: Some("A1".into()),
            usb_id: None,
        };
        let gripper = line("USB-RS485 Cable").gripper();
        assert_eq!(gripper, Some(("perhaps a Robotiq 2F-85", "robotiq:///dev/ttyUSB0".into())));
        assert_eq!(
            (line("Arduino Uno").gripper(), line("Arduino Uno").described()),
            (None, "Arduino Uno serial A1".into())
        );
    }

    #[test]
    fn a_line_is_what_has_a_device_behind_it() {
        let folder = tempfile::tempdir().expect("writable");
        let listed = |name: &str, has_device: bool, kind: Option<&str>| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.join(if has_device { "device" } else { "power" })).expect("writable");
            kind.into_iter().for_each(|kind| fs::write(path.join("type"), kind).expect("writable"));
            is_line(&path)
        };
        assert!(listed("ttyUSB0", true, None) && listed("ttyTHS1", true, Some("103\n")));
        assert!(listed("ttyS0", true, Some("4\n")) && !listed("ttyS1", true, Some("0\n")));
        assert!(!listed("tty7", false, None) && !listed("hvc0", true, None));
    }

    #[test]
    fn looking_for_lines_never_fails() {
        assert!(serial_lines().iter().all(|line| line.path.starts_with("/dev")));
    }
}
