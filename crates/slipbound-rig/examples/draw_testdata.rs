//! Draws testdata/twist.avi: a painted finger is pressed, the object turns, and slip spreads from the rim.
//!
//! `cargo run --release -p slipbound-rig --example draw_testdata` makes the same bytes again.

#[path = "../../slipbound/tests/picture/mod.rs"]
mod picture;

use picture::{Painter, Touch, encode};
use slipbound::image::SizePx;
use slipbound::plane::{RigidMotion, Vec2};
use slipbound::sensor::Skin;
use slipbound_rig::avi_writer::AviWriter;
use std::path::Path;

const SIZE: SizePx = SizePx::new(427, 320);
const PITCH_PX: f64 = 20.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let painter =
        Painter { noise_levels: 2.0, jpeg_quality: None, ..Painter::new(SIZE, PITCH_PX, 7.0, Skin::Fabric, 0.4, 2019) };
    let centre = Vec2::new(214.0, 160.0);
    let mut avi = AviWriter::create(Path::new("testdata/twist.avi"), SIZE, 30)?;
    for i in 0..48u64 {
        let pressed = (i.saturating_sub(8) as f64 / 5.0).min(1.0);
        let turn = (i.saturating_sub(15) as f64 / 30.0).min(1.0);
        let radii_px = Vec2::new(6.4, 5.2) * (PITCH_PX * (0.4 + 0.6 * pressed));
        let touch = Touch { centre, radii_px, strength_levels: 30.0 * pressed };
        let object =
            RigidMotion { reference: centre, translation: Vec2::new(7.0, 2.0) * turn, rotation_rad: 0.2 * turn };
        // The stuck middle shrinks as the load grows; beyond it the gel follows less and less, outside it relaxes.
        let stick = 1.05 - 0.62 * turn;
        let follows = |p: Vec2| 1.0 / (1.0 + (3.2 * (touch.depth(p) - stick).max(0.0)).powi(2));
        let now: Vec<Vec2> =
            painter.rest.iter().map(|&p| p + object.displacement(p) * (follows(p) * pressed)).collect();
        let seen = (pressed > 0.0).then_some(&touch);
        avi.push(&encode(&painter.paint(&now, seen, i), SIZE, 80))?;
    }
    avi.finish()?;
    Ok(())
}
