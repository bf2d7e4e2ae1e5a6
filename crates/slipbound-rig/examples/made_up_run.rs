//! Writes the folder and page of a made-up run, to look at: `made_up_run FOLDER`.

#[path = "../tests/run/screw.rs"]
mod screw;

use slipbound::image::{Rgb, SizePx};
use slipbound::task::Ending;
use slipbound_rig::run::RunFolder;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("expected a folder")?;
    let mut run = RunFolder::create(Path::new(&folder), &screw::info())?;
    let picture = picture();
    let size = SizePx::new(PICTURE_PX.0, PICTURE_PX.1);
    for cycle in screw::cycles() {
        let before = run.slips_count();
        run.cycle(&cycle)?;
        if run.slips_count() > before {
            for finger in &screw::info().fingers {
                run.picture(cycle.time_ns, &finger.name, "made up", Rgb::new(&picture, size)?)?;
            }
        }
        if cycle.hand.seq == 150 {
            run.note(cycle.time_ns, "fault put in: the right finger sends no frames for 0.3 s")?;
        }
    }
    println!("{}", run.finish(&screw::results(), Some(Ending::Tight))?.display());
    Ok(())
}

/// Width and height of [`picture`], px.
const PICTURE_PX: (usize, usize) = (1208, 560);

/// Two panels of dots, as RGB bytes.
fn picture() -> Vec<u8> {
    let (width, height) = PICTURE_PX;
    let colour = |i: usize| {
        let (x, y) = (i % width, i / width);
        let dot = (x % 40).abs_diff(20).pow(2) + (y % 40).abs_diff(20).pow(2) < 50;
        let gap = (600..608).contains(&x);
        match (gap, dot) {
            (true, _) => [22, 25, 30],
            (_, true) => [40, 40, 44],
            _ => [120 + (x / 12) as u8, 130 + (y / 8) as u8, 150],
        }
    };
    (0..width * height).flat_map(colour).collect()
}
