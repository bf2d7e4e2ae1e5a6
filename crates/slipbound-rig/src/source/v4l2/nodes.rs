//! The available cameras: `/sys/class/video4linux`, and what each node reports about itself.

use super::sys::{Device, STREAMS_PICTURES};
use crate::devices::CameraNode;
use std::fs;
use std::path::{Path, PathBuf};

/// Where the kernel lists video devices.
const LIST: &str = "/sys/class/video4linux";

/// Levels above a node at which the USB device with the serial number is searched.
const LEVELS_MOST: usize = 6;

/// Every camera that streams images, by number. Nodes that do not (a camera's metadata, say) are left out, and so are
/// those that cannot be opened: the second result holds their paths and reasons.
pub fn cameras() -> (Vec<CameraNode>, Vec<String>) {
    let (mut found, mut refused) = (Vec::new(), Vec::new());
    let Ok(list) = fs::read_dir(LIST) else { return (found, refused) };
    let mut names: Vec<String> = list.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| name.starts_with("video"));
    names.sort_by_key(|name| (name.len(), name.clone()));
    for name in names {
        let path = Path::new("/dev").join(&name);
        match look(&path, &Path::new(LIST).join(&name)) {
            Ok(node) => found.extend(node),
            Err(e) => refused.push(format!("{}: {e}", path.display())),
        }
    }
    (found, refused)
}

/// The camera behind a node; None when it does not stream images.
pub(super) fn look(path: &Path, listed: &Path) -> std::io::Result<Option<CameraNode>> {
    let device = Device::open(path)?;
    let identity = device.identity()?;
    let formats: Vec<String> = device.formats().iter().map(four_letters).collect();
    if identity.can & STREAMS_PICTURES != STREAMS_PICTURES || formats.is_empty() {
        return Ok(None);
    }
    let read = |path: PathBuf| fs::read_to_string(path).ok().map(|text| text.trim().to_owned());
    let usb_device = usb_device(listed);
    let fact = |file: &str| usb_device.as_ref().and_then(|folder| read(folder.join(file)));
    let (serial, usb_id) = (fact("serial"), fact("idVendor").zip(fact("idProduct")));
    Ok(Some(CameraNode { path: path.to_owned(), name: identity.card, serial, usb_device, usb_id, formats }))
}

/// The folder of the USB device that a listed node belongs to.
fn usb_device(listed: &Path) -> Option<PathBuf> {
    let start = fs::canonicalize(listed.join("device")).ok()?;
    let is_device = |folder: &&Path| folder.join("idVendor").exists() && folder.join("idProduct").exists();
    start.ancestors().take(LEVELS_MOST).find(is_device).map(Path::to_owned)
}

/// As it is written: `YUYV`.
pub(super) fn four_letters(four_cc: &[u8; 4]) -> String {
    four_cc.iter().map(|&letter| if letter.is_ascii_graphic() { char::from(letter) } else { ' ' }).collect()
}

/// The one camera that `wanted` names: by path, serial number, whole name, or part of a name; the error says why there
/// is none.
pub(super) fn choose<'a>(cameras: &'a [CameraNode], wanted: &str) -> Result<&'a CameraNode, String> {
    let is = |test: &dyn Fn(&CameraNode) -> bool| cameras.iter().filter(|c| test(c)).collect::<Vec<_>>();
    let lower = wanted.to_lowercase();
    let tests: [&dyn Fn(&CameraNode) -> bool; 4] = [
        &|camera| camera.path == Path::new(wanted),
        &|camera| camera.serial.as_deref() == Some(wanted),
        &|camera| camera.name == wanted,
        &|camera| camera.name.to_lowercase().contains(&lower),
    ];
    let listed = || match cameras {
        [] => "there is no camera".to_owned(),
        some => format!("there are {}", some.iter().map(CameraNode::described).collect::<Vec<_>>().join("; ")),
    };
    if wanted.is_empty() || wanted.bytes().all(|byte| byte.is_ascii_digit()) && is(tests[1]).is_empty() {
        return Err(format!(
            "v4l2:PATH, NAME or SERIAL, for numbers change from start to start; {} (`slipbound devices`)",
            listed()
        ));
    }
    for test in tests {
        match is(test).as_slice() {
            [] => {}
            [only] => return Ok(only),
            // Several streaming nodes of one camera: the first, as every program takes.
            [first, others @ ..]
                if first.usb_device.is_some() && others.iter().all(|o| o.usb_device == first.usb_device) =>
            {
                return Ok(first);
            }
            several => {
                let all: Vec<String> = several.iter().map(|camera| camera.described()).collect();
                return Err(format!("one camera, got {}: name the one by path or serial", all.join("; ")));
            }
        }
    }
    Err(format!("a camera `{wanted}`; {} (`slipbound devices`)", listed()))
}

/// Which camera it is, whatever its address names later: nodes are numbered in the order in which cameras come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct CameraId {
    first: CameraNode,
    /// Whether another camera has the same serial number.
    is_serial_shared: bool,
}

impl CameraId {
    /// That of a node among all.
    pub fn of(first: &CameraNode, cameras: &[CameraNode]) -> Self {
        CameraId { first: first.clone(), is_serial_shared: has_twin(first, cameras) }
    }

    fn is(&self, node: &CameraNode, cameras: &[CameraNode]) -> bool {
        let first = &self.first;
        let is_at_its_place = node.usb_device == first.usb_device && node.name == first.name;
        let tells_apart = first.serial.is_some() && !self.is_serial_shared && !has_twin(node, cameras);
        node.serial == first.serial && (tells_apart || is_at_its_place)
    }

    fn described(&self) -> String {
        match (&self.first.serial, &self.first.usb_device) {
            (Some(serial), _) if !self.is_serial_shared => format!("the one with serial {serial}"),
            (_, Some(place)) => format!("{} at {}", self.first.name, place.display()),
            (_, None) => self.first.name.clone(),
        }
    }
}

/// Whether another camera has the same serial number.
fn has_twin(node: &CameraNode, cameras: &[CameraNode]) -> bool {
    cameras.iter().any(|other| other.serial == node.serial && other.usb_device != node.usb_device)
}

/// The camera that was chosen as `first` before; None while it is not there. The error says which other one `wanted`
/// names now.
pub(super) fn choose_again<'a>(
    cameras: &'a [CameraNode],
    wanted: &str,
    first: &CameraId,
) -> Result<Option<&'a CameraNode>, String> {
    let named = choose(cameras, wanted).ok();
    if named.is_some_and(|named| first.is(named, cameras)) {
        return Ok(named);
    }
    // Of several nodes of the camera, one with the same images.
    let is_it = |node: &&CameraNode| first.is(node, cameras) && node.formats == first.first.formats;
    match (cameras.iter().find(is_it), named) {
        (None, Some(other)) => Err(format!("{}, got {}", first.described(), other.described())),
        (found, _) => Ok(found),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::slice;

    fn camera(number: u32, name: &str, serial: Option<&str>) -> CameraNode {
        CameraNode {
            path: format!("/dev/video{number}").into(),
            name: name.into(),
            serial: serial.map(str::to_owned),
            usb_device: serial.map(|serial| format!("/sys/devices/usb1/{serial}").into()),
            usb_id: None,
            formats: vec!["YUYV".into()],
        }
    }

    #[test]
    fn a_camera_is_chosen_by_path_serial_or_name_and_never_guessed() {
        let all = [
            camera(0, "Integrated Webcam", None),
            camera(2, "GelSight Mini R0B 28H8", Some("28H8")),
            camera(3, "GelSight Mini R0B 28H8", Some("28H8")),
            camera(4, "GelSight Mini R0B 41AA", Some("41AA")),
        ];
        let path = |wanted: &str| choose(&all, wanted).map(|camera| camera.path.display().to_string());
        assert_eq!(path("/dev/video4"), Ok("/dev/video4".into()));
        assert_eq!(path("28H8"), Ok("/dev/video2".into()), "the first of the two nodes of one camera");
        assert_eq!(path("webcam"), Ok("/dev/video0".into()));
        let several = path("gelsight").expect_err("two fingers");
        assert!(several.contains("serial 28H8") && several.contains("serial 41AA"), "{several}");
        assert!(path("0").expect_err("a number").contains("numbers change"), "{:?}", path("0"));
        assert!(path("").expect_err("nothing").contains("Integrated Webcam"));
        assert!(path("digit").expect_err("none such").starts_with("a camera `digit`; there are"));
        assert!(choose(&[], "x").expect_err("none").contains("there is no camera"));
        // Cheap modules all have the same serial number.
        let twins = [2, 4].map(|number| twin(number, number));
        for wanted in ["0001", "UVC Camera"] {
            let two = choose(&twins, wanted).expect_err("two cameras");
            assert!(two.contains("/dev/video2") && two.contains("/dev/video4"), "{two}");
        }
    }

    /// A module of a kind of which every one has the same serial number, at a port.
    fn twin(number: u32, port: u32) -> CameraNode {
        let usb_device = Some(format!("/sys/devices/usb1/1-{port}").into());
        CameraNode { usb_device, ..camera(number, "UVC Camera", Some("0001")) }
    }

    #[test]
    fn a_camera_that_is_back_is_the_one_that_was_lost_and_no_other_at_its_address() {
        let (left, right) = (camera(0, "Mini", Some("28H8")), camera(2, "Mini", Some("41AA")));
        let first = CameraId::of(&left, &[left.clone(), right.clone()]);
        let again = |cameras: &[CameraNode], wanted: &str, first: &CameraId| {
            choose_again(cameras, wanted, first).map(|found| found.map(|node| node.path.display().to_string()))
        };
        let at = |path: &str| Ok(Some(path.to_owned()));
        assert_eq!(again(&[left.clone(), right.clone()], "/dev/video0", &first), at("/dev/video0"));
        // The other one is back first, and has its number.
        let (right, left) = (camera(0, "Mini", Some("41AA")), camera(1, "Mini", Some("28H8")));
        let other = "the one with serial 28H8, got /dev/video0 Mini serial 41AA";
        for wanted in ["/dev/video0", "Mini"] {
            assert_eq!(again(slice::from_ref(&right), wanted, &first), Err(other.into()), "{wanted}");
            assert_eq!(again(&[right.clone(), left.clone()], wanted, &first), at("/dev/video1"), "{wanted}");
        }
        assert_eq!(again(&[right], "28H8", &first), Ok(None));
        assert_eq!(again(&[], "/dev/video0", &first), Ok(None));
        // It may be at another port.
        let moved = CameraNode { usb_device: Some("/sys/devices/usb2/2-1".into()), ..left };
        assert_eq!(again(&[moved], "/dev/video0", &first), at("/dev/video1"));
    }

    #[test]
    fn cameras_of_one_serial_number_or_none_are_known_by_their_port() {
        let first = CameraId::of(&twin(0, 4), &[twin(0, 4), twin(2, 5)]);
        let lone = CameraId::of(&twin(0, 4), &[twin(0, 4)]);
        let error = "UVC Camera at /sys/devices/usb1/1-4, got /dev/video0 UVC Camera serial 0001";
        assert_eq!(choose_again(&[twin(0, 5)], "/dev/video0", &first), Err(error.into()));
        for first in [&first, &lone] {
            let both = [twin(0, 5), twin(2, 4)];
            assert_eq!(choose_again(&both, "/dev/video0", first), Ok(Some(&both[1])), "the other came first");
        }
        let bare = |number, port: u32| CameraNode { serial: None, ..twin(number, port) };
        let first = CameraId::of(&bare(0, 4), &[bare(0, 4)]);
        assert!(choose_again(&[bare(0, 5)], "/dev/video0", &first).is_err());
        assert_eq!(choose_again(&[bare(3, 4)], "/dev/video0", &first), Ok(Some(&bare(3, 4))));
        // Cameras that are not on USB have neither.
        let built_in = camera(0, "Integrated Webcam", None);
        let first = CameraId::of(&built_in, slice::from_ref(&built_in));
        assert_eq!(choose_again(slice::from_ref(&built_in), "webcam", &first), Ok(Some(&built_in)));
        // Of two kinds of images of one camera the same.
        let depth = CameraNode { formats: vec!["Z16 ".into()], ..camera(0, "D405", Some("7")) };
        let colour = camera(2, "D405", Some("7"));
        let first = CameraId::of(&colour, &[depth.clone(), colour.clone()]);
        let renumbered = [CameraNode { path: "/dev/video4".into(), ..depth }, camera(6, "D405", Some("7"))];
        assert_eq!(choose_again(&renumbered, "/dev/video2", &first), Ok(Some(&renumbered[1])));
    }
}
