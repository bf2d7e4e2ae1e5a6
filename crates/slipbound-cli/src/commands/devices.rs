//! `slipbound devices`: the cameras and serial lines of this computer, and how to name them.

use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use slipbound_rig::devices::{self, CameraNode, SerialLine};

/// The arguments of `slipbound devices`.
#[derive(Debug, clap::Args)]
pub struct Devices {
    /// Print udev rules that give every camera and serial line with a serial number a name that stays, and that everybody
    /// may open
    #[arg(long)]
    udev: bool,
}

impl Devices {
    /// Lists them; a computer without any is not a failure.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let (cameras, refused) = devices::cameras();
        let lines = devices::serial_lines();
        let mut terminal = Terminal::plain();
        let text = if self.udev { rules(&cameras, &lines) } else { list(&cameras, &lines) };
        for line in text {
            terminal.say(&line)?;
        }
        for reason in refused {
            terminal.note(&format!("{reason} (may this user open it? its group is mostly `video`)"));
        }
        Ok(Outcome::Done)
    }
}

fn list(cameras: &[CameraNode], lines: &[SerialLine]) -> Vec<String> {
    let mut out = vec!["cameras".to_owned()];
    for camera in cameras {
        let path = camera.path.display().to_string();
        let name = match &camera.serial {
            Some(_) if has_twin(camera, cameras) => &path,
            Some(serial) => serial,
            None if has_namesake(camera, cameras) => &path,
            None => &camera.name,
        };
        out.push(format!("  'v4l2:{name}'  {}  {}", camera.described(), camera.formats.join(" ")));
    }
    if cameras.is_empty() {
        out.push("  none found; a camera on a network is http://HOST:PORT/PATH (docs/cameras.md)".into());
    }
    out.push("serial lines".into());
    for line in lines {
        out.push(format!("  {}  {}", line.path.display(), line.described()));
        out.extend(line.gripper().map(|(what, address)| format!("    {what}: --gripper {address}")));
    }
    if lines.is_empty() {
        out.push("  none found".into());
    }
    out.push(
        "grippers that are known (docs/grippers.md), by their protocols; those on a network answer at an address"
            .into(),
    );
    out.extend(devices::GRIPPERS.iter().map(|(what, address)| format!("  {what}: {address}")));
    out
}

/// Whether another camera has the same serial number, as all of some cheap modules do.
fn has_twin(camera: &CameraNode, cameras: &[CameraNode]) -> bool {
    cameras.iter().any(|other| other.serial == camera.serial && other.usb_device != camera.usb_device)
}

/// Whether the name of a camera also names another, so that it is refused.
fn has_namesake(camera: &CameraNode, cameras: &[CameraNode]) -> bool {
    let is_same = |other: &CameraNode| other.usb_device.is_some() && other.usb_device == camera.usb_device;
    cameras.iter().any(|other| other.name == camera.name && other.path != camera.path && !is_same(other))
}

fn rules(cameras: &[CameraNode], lines: &[SerialLine]) -> Vec<String> {
    let mut out = vec![
        "# /etc/udev/rules.d/60-slipbound.rules; then: udevadm control --reload && udevadm trigger".to_owned(),
        "# A finger keeps its name wherever it is plugged in: v4l2:/dev/finger-SERIAL".to_owned(),
    ];
    for camera in cameras {
        let (Some((vendor, product)), Some(serial)) = (&camera.usb_id, &camera.serial) else { continue };
        let rule = rule("video4linux", "index}==\"0", vendor, product, serial, "finger");
        let port = camera.usb_device.as_ref().and_then(|folder| folder.file_name());
        match port.filter(|_| has_twin(camera, cameras)).map(|port| port.to_string_lossy()) {
            None => out.push(rule),
            Some(port) => {
                out.push(format!(
                    "# {}: another camera has the same serial number; a name for the USB port",
                    camera.path.display()
                ));
                let symlink = format!("KERNELS==\"{port}\", SYMLINK+=\"finger-{}-", plain(serial));
                let by_port =
                    rule.replace(&format!("SYMLINK+=\"finger-{}", plain(serial)), &format!("{symlink}{port}"));
                out.push(by_port);
            }
        }
    }
    for line in lines {
        if let (Some((vendor, product)), Some(serial)) = (&line.usb_id, &line.serial) {
            out.push(rule("tty", "", vendor, product, serial, "gripper"));
        }
    }
    if out.len() == 2 {
        out.push("# nothing with a serial number is plugged in now; such a rule looks like this:".into());
        out.push(format!("# {}", rule("video4linux", "index}==\"0", "1234", "abcd", "SERIAL", "finger")));
    }
    out
}

/// A serial number as part of a file name.
fn plain(serial: &str) -> String {
    serial.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

fn rule(subsystem: &str, node: &str, vendor: &str, product: &str, serial: &str, name: &str) -> String {
    let node = if node.is_empty() { String::new() } else { format!("ATTR{{{node}\", ") };
    let plain = plain(serial);
    format!(
        "SUBSYSTEM==\"{subsystem}\", {node}ATTRS{{idVendor}}==\"{vendor}\", ATTRS{{idProduct}}==\"{product}\", \
         ATTRS{{serial}}==\"{serial}\", SYMLINK+=\"{name}-{plain}\", MODE=\"0666\""
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_names_a_device_by_its_serial_number() {
        let ids = Some(("0c45".into(), "636d".into()));
        let camera = CameraNode {
            path: "/dev/video2".into(),
            name: "GelSight Mini".into(),
            serial: Some("28H8-X".into()),
            usb_device: Some("/sys/devices/pci0/usb1/1-2".into()),
            usb_id: ids,
            formats: vec!["MJPG".into()],
        };
        let lines = rules(std::slice::from_ref(&camera), &[]);
        assert_eq!(
            lines[2],
            "SUBSYSTEM==\"video4linux\", ATTR{index}==\"0\", ATTRS{idVendor}==\"0c45\", ATTRS{idProduct}==\"636d\", \
             ATTRS{serial}==\"28H8-X\", SYMLINK+=\"finger-28H8_X\", MODE=\"0666\""
        );
        assert!(rules(&[], &[]).iter().all(|line| line.starts_with('#')), "none there: only an example");
        let twin = CameraNode {
            path: "/dev/video4".into(),
            usb_device: Some("/sys/devices/pci0/usb1/1-3".into()),
            ..camera.clone()
        };
        let lines = rules(&[camera.clone(), twin.clone()], &[]);
        assert!(lines[3].ends_with("KERNELS==\"1-2\", SYMLINK+=\"finger-28H8_X-1-2\", MODE=\"0666\""), "{lines:?}");
        assert!(lines[5].contains("finger-28H8_X-1-3"), "{lines:?}");
        assert!(list(&[camera.clone(), twin], &[])[2].starts_with("  'v4l2:/dev/video4'  /dev/video4 GelSight Mini"));
        let named = |cameras: &[CameraNode]| list(cameras, &[])[1..].concat();
        let bare = |number: u32| CameraNode {
            path: format!("/dev/video{number}").into(),
            serial: None,
            usb_device: Some(format!("/sys/devices/pci0/usb1/1-{number}").into()),
            ..camera.clone()
        };
        assert!(named(&[bare(2)]).starts_with("  'v4l2:GelSight Mini'  /dev/video2"));
        let both = named(&[bare(2), bare(4)]);
        assert!(both.contains("'v4l2:/dev/video2'  ") && both.contains("'v4l2:/dev/video4'  "), "{both}");
        let beside = named(&[bare(4), camera.clone()]);
        assert!(beside.contains("'v4l2:/dev/video4'  ") && beside.contains("'v4l2:28H8-X'  "), "{beside}");
        assert!(list(&[camera], &[])[1].starts_with("  'v4l2:28H8-X'  /dev/video2 GelSight Mini serial 28H8-X  MJPG"));
        assert!(list(&[], &[]).iter().any(|line| line.contains("none found")));
    }
}
