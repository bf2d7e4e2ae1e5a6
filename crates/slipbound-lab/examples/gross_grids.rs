//! The load at gross slip of every object on both grids, pulled by ramps of 1 s and of 2 s, without images:
//! `cargo run --release -p slipbound-lab --example gross_grids`. Figures are in docs/simulator.md, Limits.

use slipbound_lab::objects::OBJECTS;
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Load over that of full slip, by the rule of the world and by the 99 % of work alone, the latter at the end of a
/// frame; None without gross slip.
fn loads(scene: &str) -> Result<[Option<f64>; 2], Failure> {
    let mut world = World::new(&Trial::parse(scene)?)?;
    let mut by_work = None;
    while let Some(truth) = world.advance()? {
        let slides =
            truth.friction_used_fraction.is_some_and(|used| used >= slipbound_lab::contact::GROSS_FRICTION_FRACTION);
        by_work = by_work.or(truth.load.filter(|_| slides));
    }
    Ok([world.gross().map(|gross| gross.load), by_work])
}

fn main() -> Result<(), Failure> {
    println!(
        "| object | ramp, s | world, 64 x 48 | 96 x 72 | apart | 99 % alone, 64 x 48 | 96 x 72 |\n|---|---|---|---|---|---|---|"
    );
    let told = |load: Option<f64>| load.map_or("-".into(), |load| format!("{load:.3}"));
    for object in OBJECTS.iter().map(|object| object.name) {
        for ramp_s in [1, 2] {
            let of = |grid: &str| {
                loads(&format!("ramp?object={object}&ramp_s={ramp_s}&grid={grid}&direction_deg=20&seed=1"))
            };
            let ([fast, fast_work], [fine, fine_work]) = (of("fast")?, of("standard")?);
            let apart =
                fast.zip(fine).map_or("-".into(), |(fast, fine)| format!("{:.1} %", 100.0 * (fast / fine - 1.0)));
            println!(
                "| {object} | {ramp_s} | {} | {} | {apart} | {} | {} |",
                told(fast),
                told(fine),
                told(fast_work),
                told(fine_work)
            );
        }
    }
    Ok(())
}
