//! A camera, as the kernel lists it.

use std::path::PathBuf;

/// A camera that streams images.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraNode {
    /// The node, as in `/dev/video0`.
    pub path: PathBuf,
    /// The camera's own name.
    pub name: String,
    /// The serial number of its USB device; None where it has none.
    pub serial: Option<String>,
    /// The folder of its USB device under `/sys`; it tells two cameras with the same serial number apart. None without one.
    pub usb_device: Option<PathBuf>,
    /// Vendor and product of its USB device, four hexadecimal digits each.
    pub usb_id: Option<(String, String)>,
    /// The kinds of its images, four letters each.
    pub formats: Vec<String>,
}

impl CameraNode {
    /// Path, name and serial number.
    pub fn described(&self) -> String {
        let serial = self.serial.as_ref().map_or(String::new(), |serial| format!(" serial {serial}"));
        format!("{} {}{serial}", self.path.display(), self.name)
    }
}
