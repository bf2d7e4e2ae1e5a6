//! A rest frame that was saved and loaded gives the same reports; one of another finger, or damaged, is rejected with
//! the reason.

mod picture;

use picture::{Painter, Touch, frame};
use serde_json::Value;
use slipbound::image::SizePx;
use slipbound::monitor::{Rest, RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::plane::Vec2;
use slipbound::port::GripSample;
use slipbound::sensor::Skin;

const SIZE: SizePx = SizePx::new(320, 240);

fn finger(skin: Skin) -> (Painter, Rest) {
    let painter = Painter::new(SIZE, 16.0, 5.5, skin, 0.5, 4);
    let mut builder = RestBuilder::new(&painter.sensor, &Settings::default(), SIZE).expect("valid");
    builder.add(&frame(&painter.paint(&painter.rest, None, 0), SIZE, 0)).expect("bright");
    let rest = builder.build(RestKind::Unloaded).expect("markers");
    (painter, rest)
}

#[test]
fn a_rest_frame_that_was_loaded_gives_the_same_reports() {
    for skin in [Skin::Smooth, Skin::Fabric] {
        let (painter, rest) = finger(skin);
        let text = serde_json::to_string(&rest).expect("numbers");
        let loaded: Rest = serde_json::from_str(&text).expect("what was written");
        assert_eq!(loaded, rest, "{skin:?}");
        let monitor = |rest| SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect("valid");
        let (mut before, mut after) = (monitor(rest), monitor(loaded));
        let touch = Touch { centre: Vec2::new(160.0, 120.0), radii_px: Vec2::new(90.0, 75.0), strength_levels: 32.0 };
        for seq in 1..12u32 {
            let shift = Vec2::new(0.8 * f64::from(seq), 0.0);
            let now: Vec<Vec2> =
                painter.rest.iter().map(|&p| if touch.depth(p) < 0.7 { p + shift } else { p }).collect();
            let rgb = painter.paint(&now, Some(&touch), u64::from(seq));
            let frame = frame(&rgb, SIZE, u64::from(seq));
            let grip = Some(GripSample { force_n: 5.0 });
            assert_eq!(before.step(&frame, grip), after.step(&frame, grip), "{skin:?}, frame {seq}");
        }
        assert_eq!(before.markers(), after.markers());
    }
}

#[test]
fn what_is_damaged_or_another_fingers_is_refused_by_name() {
    let (painter, rest) = finger(Skin::Smooth);
    let whole = serde_json::to_value(&rest).expect("numbers");
    let refused = |spoil: &dyn Fn(&mut Value)| {
        let mut spoiled = whole.clone();
        spoil(&mut spoiled);
        let rest: Rest = serde_json::from_value(spoiled).expect("of the right shape");
        SlipMonitor::new(&painter.sensor, &Settings::default(), rest).expect_err("spoiled").to_string()
    };
    let short = |key: &'static str| {
        move |rest: &mut Value| {
            rest[key].as_array_mut().expect("a list").pop();
        }
    };
    assert_eq!(refused(&short("grey")), "rest.grey: expected 76800 values, got 76799");
    assert!(refused(&short("cells")).starts_with("rest.cells: expected "));
    assert!(refused(&short("cells_covered")).starts_with("rest.cells_covered: expected "));
    assert!(refused(&|rest| rest["markers"] = Value::Array(Vec::new())).starts_with("rest.markers: "));
    assert!(
        refused(&|rest| rest["markers"][3]["position"][0] = 1e9.into()).starts_with("rest.markers[3].position.x: ")
    );
    assert!(refused(&|rest| rest["markers"][2]["stiffness"] = 1e300.into()).starts_with("rest.markers[2].stiffness: "));
    let grown = refused(&|rest| rest["size"] = serde_json::json!([640, 480]));
    assert!(grown.starts_with("rest.grey: expected 307200 values, got 76800"), "{grown}");
    let woven = finger(Skin::Fabric).0.sensor;
    let flat = SlipMonitor::new(&woven, &Settings::default(), rest).expect_err("rest of a smooth gel").to_string();
    assert_eq!(flat, "rest.flat: expected 76800 values, got 0");
    let mut unknown = whole.clone();
    unknown["colour"] = 1.into();
    assert!(serde_json::from_value::<Rest>(unknown).is_err());
}
