//! The parameters of the node: a TOML file. `example.toml` contains every key.

mod control;

pub use control::{Control, GripperAddress};

use crate::error::Error;
use crate::ros::{ServiceMapping, checked_node, full_topic};
use control::ControlFile;
use ros2_client::Name;
use serde::Deserialize;
use slipbound::monitor::Settings;
use slipbound::setting::SettingError;
use slipbound_rig::config::hand::{FingerConfig, HandConfig};
use slipbound_rig::config::{self, hand};
use std::path::{Path, PathBuf};

/// Largest ROS domain: beyond it there are not enough ports (REP 2003 allows 232).
const DOMAIN_MOST: u16 = 232;

/// The parameters of a node, checked.
#[derive(Debug, Clone)]
pub struct Config {
    /// Its name.
    pub node: String,
    /// Its namespace.
    pub namespace: String,
    /// Its domain.
    pub domain_id: u16,
    /// How its services are laid out on DDS.
    pub service_mapping: ServiceMapping,
    /// Name of the hand's frame of reference.
    pub hand_frame: String,
    /// Settings of the method.
    pub settings: Settings,
    /// QoS of the image subscriptions.
    pub image_qos: ImageQos,
    /// Topic on which a gripper reports its force; None: no force.
    pub gripper_state_topic: Option<String>,
    /// Whether overlay images are published.
    pub overlay: bool,
    /// Whether the node configures and activates itself: when every rest frame is known, or 4 s after the first is.
    pub autostart: bool,
    /// The fingers with their topics, in the order of the hand file.
    pub fingers: Vec<Finger>,
    /// Gripper, wrist and controller; the node itself commands nothing.
    pub control: Option<Control>,
}

/// A finger and the source of its images.
#[derive(Debug, Clone)]
pub struct Finger {
    /// Its entry in the hand file.
    pub finger: FingerConfig,
    /// Topic of its images.
    pub image_topic: String,
    /// Their type.
    pub image_type: ImageType,
    /// `frame_id` of its wrenches: the frame whose axes are those of the rectified image.
    pub wrench_frame: String,
}

/// QoS of the image subscriptions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImageQos {
    /// Sensor data: best effort, the last five.
    SensorData,
    /// Lost images are sent again; the publisher must offer it.
    Reliable,
}

/// Message type of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImageType {
    /// `sensor_msgs/CompressedImage`.
    Compressed,
    /// `sensor_msgs/Image`.
    Raw,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ConfigFile {
    #[serde(default = "node_name")]
    node: String,
    #[serde(default = "root")]
    namespace: String,
    domain_id: Option<u16>,
    hand: PathBuf,
    #[serde(default)]
    service_mapping: ServiceMapping,
    #[serde(default = "hand_frame")]
    hand_frame: String,
    settings: Option<String>,
    #[serde(default = "sensor_data")]
    image_qos: ImageQos,
    gripper_state_topic: Option<String>,
    #[serde(default)]
    overlay: bool,
    #[serde(default = "yes")]
    autostart: bool,
    fingers: Vec<FingerFile>,
    control: Option<ControlFile>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FingerFile {
    name: String,
    image_topic: String,
    #[serde(default = "compressed")]
    image_type: ImageType,
    wrench_frame: Option<String>,
}

fn node_name() -> String {
    "slipbound".into()
}

fn root() -> String {
    "/".into()
}

fn hand_frame() -> String {
    "hand".into()
}

fn sensor_data() -> ImageQos {
    ImageQos::SensorData
}

fn yes() -> bool {
    true
}

fn compressed() -> ImageType {
    ImageType::Compressed
}

/// Reads the parameters and the files they name, which are in the same folder. `domain_id`: the value of
/// `ROS_DOMAIN_ID`, which the file overrides. The error names file, key, expected and got.
pub fn load(path: &Path, domain_id: Option<&str>) -> Result<Config, Error> {
    let file: ConfigFile = config::load(path)?;
    let refuse =
        |source: SettingError| Error::Config(config::Error::OutOfRange { file: path.display().to_string(), source });
    let folder = path.parent().unwrap_or(Path::new(""));
    let HandConfig { fingers: known, .. } = hand::load(&folder.join(&file.hand))?;
    let settings = match file.settings.as_deref() {
        None => Settings::default(),
        Some("paper") => Settings::paper(),
        Some(name) => config::load_settings(&folder.join(name).display().to_string())?,
    };
    let domain_id = match file.domain_id {
        Some(id) if id > DOMAIN_MOST => {
            return Err(refuse(wrong("domain_id", format!("at most {DOMAIN_MOST}"), id.to_string())));
        }
        Some(id) => id,
        None => domain_of_environment(domain_id)?,
    };
    let node = match checked_node(&file.namespace, &file.node) {
        Ok(node) => node.fully_qualified_name(),
        Err(Error::Name { key, name, why }) => {
            let expected = match key.as_str() {
                "namespace" => "a namespace that ROS takes, as `/` or `/arm`",
                _ => "the name of a node that ROS takes",
            };
            return Err(refuse(wrong(&key, expected, format!("`{name}`: {why}"))));
        }
        Err(e) => return Err(e),
    };
    check_frame("hand_frame", &file.hand_frame).map_err(refuse)?;
    if let Some(topic) = &file.gripper_state_topic {
        check_topic("gripper_state_topic", &full_topic(&node, topic), topic).map_err(refuse)?;
    }
    check_fingers(&file, &known, &node).map_err(refuse)?;
    let control = file.control.as_ref().map(|control| control.check(path)).transpose()?;
    let fingers = known.into_iter().filter_map(|finger| {
        let topic = file.fingers.iter().find(|other| other.name == finger.name)?;
        let wrench_frame = topic.wrench_frame.clone().unwrap_or_else(|| format!("{}_gel", finger.name));
        Some(Finger { finger, image_topic: topic.image_topic.clone(), image_type: topic.image_type, wrench_frame })
    });
    Ok(Config {
        fingers: fingers.collect(),
        node: file.node,
        namespace: file.namespace,
        domain_id,
        service_mapping: file.service_mapping,
        hand_frame: file.hand_frame,
        settings,
        image_qos: file.image_qos,
        gripper_state_topic: file.gripper_state_topic,
        overlay: file.overlay,
        autostart: file.autostart,
        control,
    })
}

fn wrong(key: &str, expected: impl Into<String>, got: impl Into<String>) -> SettingError {
    SettingError { key: key.into(), expected: expected.into(), got: got.into() }
}

/// The domain that `ROS_DOMAIN_ID` names. Set to nothing, as by a compose file, it counts as not set: domain 0.
pub fn domain_of_environment(text: Option<&str>) -> Result<u16, Error> {
    let Some(text) = text.filter(|text| !text.trim().is_empty()) else { return Ok(0) };
    let id = text.trim().parse().ok().filter(|id| *id <= DOMAIN_MOST);
    let expected = format!("a whole number from 0 to {DOMAIN_MOST}");
    id.ok_or_else(|| Error::Setting(wrong("ROS_DOMAIN_ID", expected, format!("`{text}`"))))
}

/// tf2 rejects a name that is empty or begins with a slash.
fn check_frame(key: &str, frame: &str) -> Result<(), SettingError> {
    match frame.is_empty() || frame.starts_with('/') {
        true => Err(wrong(key, "the name of a frame, without a slash at its beginning", format!("`{frame}`"))),
        false => Ok(()),
    }
}

fn check_topic(key: &str, full: &str, topic: &str) -> Result<(), SettingError> {
    match Name::parse(full) {
        Ok(_) => Ok(()),
        Err(_) => Err(wrong(key, "the name of a topic", format!("`{topic}`"))),
    }
}

/// Every finger of the hand once, each with topics that ROS takes, and with images of its own.
fn check_fingers(file: &ConfigFile, known: &[FingerConfig], node: &str) -> Result<(), SettingError> {
    let names: Vec<String> = known.iter().map(|finger| format!("`{}`", finger.name)).collect();
    let hand_fingers = format!("every finger of {} once: {}", file.hand.display(), names.join(", "));
    for (i, finger) in file.fingers.iter().enumerate() {
        let (key, before) = (|name: &str| format!("fingers[{i}].{name}"), &file.fingers[..i]);
        let is_known = known.iter().any(|other| other.name == finger.name);
        if !is_known || before.iter().any(|other| other.name == finger.name) {
            return Err(wrong(&key("name"), hand_fingers, format!("`{}`", finger.name)));
        }
        if finger.name == "hand" {
            let expected = "a name of its own: hand/report is the topic of the whole hand";
            return Err(wrong(&key("name"), expected, "`hand`"));
        }
        // The names of its topics contain it.
        if Name::parse(&full_topic(node, &format!("{}/report", finger.name))).is_err() {
            let expected = "a name that ROS takes: letters, digits and _, no digit first";
            return Err(wrong(&key("name"), expected, format!("`{}`", finger.name)));
        }
        let topic = full_topic(node, &finger.image_topic);
        check_topic(&key("image_topic"), &topic, &finger.image_topic)?;
        // Two fingers with the same images would always agree.
        if let Some(other) = before.iter().find(|other| full_topic(node, &other.image_topic) == topic) {
            let expected = format!("a topic of its own, other than that of `{}`", other.name);
            return Err(wrong(&key("image_topic"), expected, format!("`{}`", finger.image_topic)));
        }
        if let Some(frame) = &finger.wrench_frame {
            check_frame(&key("wrench_frame"), frame)?;
        }
    }
    match file.fingers.len() < known.len() {
        true => Err(wrong("fingers", hand_fingers, format!("{} fingers", file.fingers.len()))),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HAND: &str = "name = \"two\"\n\
        [[fingers]]\nname = \"left\"\nserial = \"A\"\nside = \"left\"\nsensor = \"gelslim\"\n\
        [[fingers]]\nname = \"right\"\nserial = \"B\"\nside = \"right\"\nsensor = \"gelslim\"\n";
    const NODE: &str = "hand = \"hand.toml\"\ndomain_id = 7\n\
        [[fingers]]\nname = \"right\"\nimage_topic = \"/right/image\"\nimage_type = \"raw\"\n\
        [[fingers]]\nname = \"left\"\nimage_topic = \"/left/image/compressed\"\n";

    fn read(text: &str, domain_id: Option<&str>) -> Result<Config, Error> {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("hand.toml"), HAND).expect("writes");
        let path = folder.path().join("node.toml");
        std::fs::write(&path, text).expect("writes");
        load(&path, domain_id)
    }

    #[test]
    fn fingers_are_in_the_order_of_the_hand() {
        let config = read(NODE, Some("9")).expect("valid");
        let fingers: Vec<_> = config.fingers.iter().map(|f| (f.finger.name.as_str(), f.image_type)).collect();
        assert_eq!(fingers, [("left", ImageType::Compressed), ("right", ImageType::Raw)]);
        assert_eq!((config.node.as_str(), config.domain_id, config.overlay), ("slipbound", 7, false));
        assert_eq!(read(&NODE.replace("domain_id = 7\n", ""), Some("9")).expect("valid").domain_id, 9);
        let waits = read(&NODE.replace("domain_id = 7\n", "autostart = false\n"), None).expect("valid");
        assert!(config.autostart && !waits.autostart);
    }

    #[test]
    fn services_and_wrench_frames_have_defaults_and_can_be_set() {
        let config = read(NODE, None).expect("valid");
        assert_eq!(config.service_mapping, ServiceMapping::Enhanced);
        assert_eq!(config.fingers.iter().map(|f| &*f.wrench_frame).collect::<Vec<_>>(), ["left_gel", "right_gel"]);
        let text = NODE
            .replace("domain_id = 7\n", "service_mapping = \"cyclone\"\n")
            .replace("image_type = \"raw\"\n", "wrench_frame = \"finger_2_pad\"\n");
        let config = read(&text, None).expect("valid");
        assert_eq!(config.service_mapping, ServiceMapping::Cyclone);
        assert_eq!(config.fingers.iter().map(|f| &*f.wrench_frame).collect::<Vec<_>>(), ["left_gel", "finger_2_pad"]);
    }

    /// With what is commented out, which stands there as it is left or as another choice.
    #[test]
    fn the_example_is_valid_with_every_key() {
        let folder = tempfile::tempdir().expect("a folder");
        let keys =
            |line: &'static str| line.strip_prefix("# ").filter(|key| key.contains(" = ") || key.starts_with('['));
        let with_action = |line: &str| line.replace("ros2:///hand/gripper", "ros2+action:///gripper_cmd");
        let text: Vec<String> =
            include_str!("../example.toml").lines().map(|line| with_action(keys(line).unwrap_or(line))).collect();
        let path = folder.path().join("node.toml");
        for (name, text) in [
            ("hand.toml", include_str!("../hand.toml")),
            ("node.toml", &text.join("\n")),
            ("mine.toml", ""),
            ("task.toml", ""),
        ] {
            std::fs::write(folder.path().join(name), text).expect("writes");
        }
        let config = load(&path, None).expect("valid");
        let control = config.control.expect("a table");
        assert!(matches!(control.gripper, GripperAddress::Action(action) if action.joint == "finger_joint"));
        assert_eq!((config.fingers.len(), control.wrist.as_deref()), (2, Some("/hand/wrist")));
    }

    #[test]
    fn mistakes_name_file_key_expected_and_got() {
        for (from, to, parts) in [
            ("hand = ", "hnad = ", ["node.toml", "`hnad`", "did you mean `hand`?"]),
            ("domain_id = 7", "domain_id = 240", ["node.toml: domain_id", "at most 232", "240"]),
            ("domain_id = 7", "overlay = \"yes\"", ["node.toml: overlay", "yes", "expected a boolean"]),
            ("\"raw\"", "\"png\"", ["node.toml: fingers[0].image_type", "png", "`compressed`"]),
            ("domain_id = 7", "service_mapping = \"basic\"", ["service_mapping", "basic", "`cyclone`"]),
            (
                "image_type = \"raw\"",
                "wrench_frame = \"\"",
                ["node.toml: fingers[0].wrench_frame", "name of a frame", "``"],
            ),
            (
                "image_type = \"raw\"",
                "wrench_frame = \"/gel\"",
                ["fingers[0].wrench_frame", "without a slash", "`/gel`"],
            ),
            (
                "\"/left/image/compressed\"",
                "\"/right/image\"",
                ["fingers[1].image_topic", "of its own, other than that of `right`", "`/right/image`"],
            ),
            ("\"/right/image\"", "\"two words\"", ["fingers[0].image_topic", "the name of a topic", "`two words`"]),
            (
                "domain_id = 7",
                "gripper_state_topic = \"two words\"",
                ["node.toml: gripper_state_topic", "the name of a topic", "`two words`"],
            ),
            ("domain_id = 7", "hand_frame = \"/\"", ["node.toml: hand_frame", "without a slash", "`/`"]),
            ("domain_id = 7", "hand_frame = \"\"", ["node.toml: hand_frame", "name of a frame", "``"]),
            ("domain_id = 7", "namespace = \"x y\"", ["node.toml: namespace", "a namespace that ROS takes", "`x y`"]),
            ("domain_id = 7", "node = \"x y\"", ["node.toml: node", "the name of a node", "`x y`"]),
            ("name = \"left\"", "name = \"middle\"", ["fingers[1].name", "`left`, `right`", "`middle`"]),
            ("name = \"left\"", "name = \"right\"", ["fingers[1].name", "once", "`right`"]),
            ("\"hand.toml\"", "\"none.toml\"", ["none.toml", "cannot read", ""]),
        ] {
            let message = read(&NODE.replacen(from, to, 1), None).expect_err("refused").to_string();
            for part in parts {
                assert!(message.contains(part), "`{message}` lacks `{part}`");
            }
        }
        let anywhere = NODE.replace("domain_id = 7\n", "");
        for text in ["x", "300"] {
            let message = read(&anywhere, Some(text)).expect_err("refused").to_string();
            assert!(message.contains("ROS_DOMAIN_ID: expected a whole number from 0 to 232"), "{message}");
            assert!(message.contains(&format!("`{text}`")), "{message}");
        }
        assert_eq!(read(&anywhere, Some("")).expect("not set").domain_id, 0);
        let ros_takes = "a name that ROS takes: letters, digits and _, no digit first";
        let of_its_own = "a name of its own: hand/report is the topic of the whole hand";
        for (name, expected) in [("left-thumb", ros_takes), ("2nd", ros_takes), ("hand", of_its_own)] {
            let folder = tempfile::tempdir().expect("a folder");
            std::fs::write(
                folder.path().join("hand.toml"),
                HAND.replace("\"left\"\nserial", &format!("\"{name}\"\nserial")),
            )
            .expect("writes");
            let path = folder.path().join("node.toml");
            std::fs::write(&path, NODE.replace("name = \"left\"", &format!("name = \"{name}\""))).expect("writes");
            let message = load(&path, None).expect_err("no name of a topic").to_string();
            let said = format!("node.toml: fingers[1].name: expected {expected}, got `{name}`");
            assert!(message.contains(&said), "{message}");
        }
    }
}
