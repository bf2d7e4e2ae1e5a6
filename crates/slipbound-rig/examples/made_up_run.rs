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
    let picture = screw::picture();
    let size = SizePx::new(screw::PICTURE_PX.0, screw::PICTURE_PX.1);
    for cycle in screw::cycles() {
        let before = run.slips_count();
        run.cycle(&cycle)?;
        if run.slips_count() > before {
            for finger in &screw::info().fingers {
                run.picture(cycle.time_ns, finger, "made up", Rgb::new(&picture, size)?)?;
            }
        }
        if cycle.hand.seq == 150 {
            run.note(cycle.time_ns, "fault put in: the right finger sends no frames for 0.3 s");
        }
    }
    println!("{}", run.finish(&screw::results(), Some(Ending::Tight))?.display());
    Ok(())
}
