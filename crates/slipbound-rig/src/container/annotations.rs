//! Results on an image, as lines over it: `foxglove.ImageAnnotations`, in protocol buffers.
//!
//! ```text
//!   green   from where a marker was at rest to where it is now      three lines a marker: shaft and two of its head
//!   red     how far a marker in contact lags behind the rigid body
//!   text    the verdict
//! ```
//!
//! Lines are in the camera's pixels, as the image is; a marker that was not found has none.

use super::foxglove::{
    DOUBLE, FIELD_OF_MESSAGES, MESSAGE, STRING, TIMESTAMP, TypedField, file, put_stamp, typed_message,
};
use super::wire::{put_bytes, put_double, put_number};
use slipbound::monitor::{Marker, SlipReport, SlipState};
use slipbound::plane::Vec2;
use slipbound::sensor::Sensor;

/// The schema.
pub const SCHEMA: &str = "foxglove.ImageAnnotations";

/// Points of an arrow: three lines.
pub const ARROW_POINTS_COUNT: usize = 6;
/// Length of the head's two lines, and their distance from the shaft, as fractions of the shaft.
const HEAD_FRACTION: (f64, f64) = (0.3, 0.15);
/// Kind of a list of lines, each of two points.
const LINE_LIST: u64 = 4;
/// Red, green, blue and opacity, 0 to 1.
type Rgba = [f64; 4];
const MOVED: Rgba = [0.1, 0.8, 0.2, 0.9];
const SLIPS: Rgba = [0.95, 0.1, 0.1, 1.0];
const TEXT: Rgba = [1.0, 1.0, 1.0, 1.0];
const BEHIND: Rgba = [0.0, 0.0, 0.0, 0.5];
/// Width of a line and height of the text, camera px.
const LINE_PX: f64 = 1.0;
const TEXT_PX: f64 = 14.0;

const ENUM: u64 = 14;
const POINT: &str = ".foxglove.Point2";
const COLOR: &str = ".foxglove.Color";

/// The description (`FileDescriptorSet`) of [`SCHEMA`], with the circles, which are never written: readers look for
/// them.
pub fn description() -> Vec<u8> {
    let one = |name, number, kind| TypedField { name, number, kind, of: "", is_repeated: false };
    let of = |name, number, of| TypedField { name, number, kind: MESSAGE, of, is_repeated: false };
    let many = |name, number, of| TypedField { name, number, kind: MESSAGE, of, is_repeated: true };
    let numbers = |names: &[&'static str]| -> Vec<TypedField> {
        names.iter().zip(1..).map(|(name, number)| one(*name, number, DOUBLE)).collect()
    };
    let stamp = of("timestamp", 1, TIMESTAMP);
    let point_kind = TypedField { kind: ENUM, of: ".foxglove.PointsAnnotation.Type", ..one("type", 2, ENUM) };
    let circle = [
        stamp,
        of("position", 2, POINT),
        one("diameter", 3, DOUBLE),
        one("thickness", 4, DOUBLE),
        of("fill_color", 5, COLOR),
        of("outline_color", 6, COLOR),
    ];
    let points = [
        stamp,
        point_kind,
        many("points", 3, POINT),
        of("outline_color", 4, COLOR),
        many("outline_colors", 5, COLOR),
        of("fill_color", 6, COLOR),
        one("thickness", 7, DOUBLE),
    ];
    let text = [
        stamp,
        of("position", 2, POINT),
        one("text", 3, STRING),
        one("font_size", 4, DOUBLE),
        of("text_color", 5, COLOR),
        of("background_color", 6, COLOR),
    ];
    let all = [
        many("circles", 1, ".foxglove.CircleAnnotation"),
        many("points", 2, ".foxglove.PointsAnnotation"),
        many("texts", 3, ".foxglove.TextAnnotation"),
    ];
    let time = "google/protobuf/timestamp.proto";
    let [point_file, color_file] = ["foxglove/Point2.proto", "foxglove/Color.proto"];
    let parts = ["foxglove/CircleAnnotation.proto", "foxglove/PointsAnnotation.proto", "foxglove/TextAnnotation.proto"];
    let base = [color_file, point_file, time];
    let mut points_message = typed_message("PointsAnnotation", &points);
    put_bytes(&mut points_message, 4, &kinds_of_points());
    let mut set = Vec::new();
    let mut put = |name: &str, package: &str, needs: &[&str], message: &[u8]| {
        put_bytes(&mut set, FIELD_OF_MESSAGES, &file(name, package, needs, message));
    };
    put(time, "google.protobuf", &[], &super::foxglove::timestamp());
    put(point_file, "foxglove", &[], &typed_message("Point2", &numbers(&["x", "y"])));
    put(color_file, "foxglove", &[], &typed_message("Color", &numbers(&["r", "g", "b", "a"])));
    put(parts[0], "foxglove", &base, &typed_message("CircleAnnotation", &circle));
    put(parts[1], "foxglove", &base, &points_message);
    put(parts[2], "foxglove", &base, &typed_message("TextAnnotation", &text));
    put("foxglove/ImageAnnotations.proto", "foxglove", &parts, &typed_message("ImageAnnotations", &all));
    set
}

/// The description of the enumeration `Type`.
fn kinds_of_points() -> Vec<u8> {
    let mut out = Vec::new();
    put_bytes(&mut out, 1, b"Type");
    for (name, number) in ["UNKNOWN", "POINTS", "LINE_LOOP", "LINE_STRIP", "LINE_LIST"].into_iter().zip(0..) {
        let mut value = Vec::new();
        put_bytes(&mut value, 1, name.as_bytes());
        put_number(&mut value, 2, number);
        put_bytes(&mut out, 2, &value);
    }
    out
}

/// The message for a judged frame with this time, ns.
pub fn write(sensor: &Sensor, report: &SlipReport, markers: &[Marker], stamp_ns: u64) -> Vec<u8> {
    let found = markers.iter().filter(|marker| marker.matched);
    let mut out = Vec::with_capacity(128 * markers.len() + 200);
    let mut moved = Lines::new(stamp_ns, 16 * markers.len());
    found.clone().for_each(|marker| moved.arrow(sensor, marker.rest, marker.now));
    put_bytes(&mut out, 2, &moved.finish(MOVED));
    let mut slips = Lines::new(stamp_ns, 0);
    found.filter(|marker| marker.over).for_each(|m| slips.arrow(sensor, m.now - m.slip, m.now));
    put_bytes(&mut out, 2, &slips.finish(SLIPS));
    put_bytes(&mut out, 3, &text(report, stamp_ns));
    out
}

fn text(report: &SlipReport, stamp_ns: u64) -> Vec<u8> {
    let mut out = Vec::new();
    put_bytes(&mut out, 1, &put_stamp(stamp_ns));
    put_bytes(&mut out, 2, &point(Vec2::new(8.0, 20.0)));
    let verdict = match (report.state, report.reason) {
        (SlipState::NoContact, _) => "no contact".to_owned(),
        (SlipState::Unsure, _) => "unsure".to_owned(),
        (SlipState::Stick, _) => "stick".to_owned(),
        (SlipState::Incipient, _) => "incipient slip".to_owned(),
        (SlipState::Gross, _) => "gross slip".to_owned(),
        (SlipState::Unjudged, reason) => reason.map_or("unjudged".into(), |reason| format!("unjudged: {reason}")),
    };
    put_bytes(&mut out, 3, verdict.as_bytes());
    put_double(&mut out, 4, TEXT_PX);
    put_bytes(&mut out, 5, &color(TEXT));
    put_bytes(&mut out, 6, &color(BEHIND));
    out
}

/// A list of lines of one colour.
struct Lines(Vec<u8>);

impl Lines {
    fn new(stamp_ns: u64, room_bytes: usize) -> Self {
        let mut out = Vec::with_capacity(room_bytes + 80);
        put_bytes(&mut out, 1, &put_stamp(stamp_ns));
        put_number(&mut out, 2, LINE_LIST);
        Lines(out)
    }

    /// Shaft and head, from rectified to camera px.
    fn arrow(&mut self, sensor: &Sensor, from: Vec2, to: Vec2) {
        let (from, to) = (sensor.camera_from_rectified(from), sensor.camera_from_rectified(to));
        let (back, aside) = ((from - to) * HEAD_FRACTION.0, (to - from).turned() * HEAD_FRACTION.1);
        for at in [from, to, to, to + back + aside, to, to + back - aside] {
            put_bytes(&mut self.0, 3, &point(at));
        }
    }

    fn finish(mut self, rgba: Rgba) -> Vec<u8> {
        put_bytes(&mut self.0, 4, &color(rgba));
        put_double(&mut self.0, 7, LINE_PX);
        self.0
    }
}

fn point(at: Vec2) -> Vec<u8> {
    let mut out = Vec::with_capacity(18);
    put_double(&mut out, 1, at.x);
    put_double(&mut out, 2, at.y);
    out
}

fn color(rgba: Rgba) -> Vec<u8> {
    let mut out = Vec::with_capacity(36);
    rgba.into_iter().zip(1..).for_each(|(part, number)| put_double(&mut out, number, part));
    out
}
