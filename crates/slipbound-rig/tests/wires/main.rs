//! The exact bytes between drivers and emulators, and the drivers' reports to the loop, as tables beside this file:
//! scripts of commands against every protocol, with faults and without. After an intended change the tables are written
//! again by
//!
//! ```text
//! REGENERATE=1 cargo test -p slipbound-rig --test wires
//! ```
//!
//! Check the difference before you commit it.

#[allow(dead_code)] // these tests use their part
#[path = "../links/bench.rs"]
mod bench;
#[path = "../../../slipbound/tests/snapshot/mod.rs"]
mod snapshot;

use bench::{Bench, MS, WIDTH_MM, config};
use slipbound::plant::Plant;
use slipbound::port::{WristCommand, WristMotion};
use slipbound_rig::emulator::{self, Block, LockstepPair};
use slipbound_rig::gripper::Request;
use slipbound_rig::gripper::config::{Config, ForceChange, ForceIs, Lowering};
use slipbound_rig::wrist::LineWrist;
use snapshot::Checksum;
use std::fmt::Write;

/// What is done, and for how many ms it then runs.
#[derive(Clone, Copy)]
enum Do {
    Grip(f64),
    Release,
    Home,
    Acknowledge,
    Leave,
    /// The object is gone, or there.
    Width(Option<f64>),
    Cut,
    Connect,
    Wait,
}

const SCRIPT: [(Do, u64); 16] = [
    (Do::Wait, 300),
    (Do::Grip(20.0), 1600),
    (Do::Grip(32.5), 900),
    (Do::Grip(11.0), 900),
    (Do::Grip(500.0), 500),
    (Do::Cut, 300),
    (Do::Connect, 700),
    (Do::Acknowledge, 200),
    (Do::Release, 1300),
    (Do::Home, 600),
    (Do::Width(None), 10),
    (Do::Grip(15.0), 2100),
    (Do::Release, 900),
    (Do::Width(Some(WIDTH_MM)), 10),
    (Do::Grip(25.0), 1500),
    (Do::Leave, 300),
];

const HEAD: &str = "ms: of the emulator's clock. pressed: force on the block, N. reads: what the driver says: jaws, opening in mm, force, target and stated error in N.\n\
    sent: bytes by the driver so far, and the sum of all that was sent, said and told.\n";

/// Runs a script against a pair: one row per step, and one wherever the kind of the driver's report changes.
fn table(title: &str, name: &str, config: Config, faults: &str) -> String {
    let mut bench = Bench::new(name, config, faults);
    let (mut sum, mut text, mut shown) = (Checksum::new(), format!("\n{title}\n"), String::new());
    for (what, ms) in SCRIPT {
        let answer = match what {
            Do::Grip(force_n) => bench.grip(force_n),
            Do::Release => bench.release(),
            Do::Home => bench.request(Request::Home),
            Do::Acknowledge => bench.request(Request::Acknowledge),
            Do::Leave => bench.request(Request::Leave),
            Do::Width(width_mm) => {
                bench.plant.width_mm = width_mm;
                Ok(())
            }
            Do::Cut => {
                bench.cut("cut by the test");
                Ok(())
            }
            Do::Connect => {
                bench.connect();
                Ok(())
            }
            Do::Wait => Ok(()),
        };
        let done = match what {
            Do::Grip(force_n) => format!("grip {force_n}"),
            Do::Release => "release".into(),
            Do::Home => "home".into(),
            Do::Acknowledge => "acknowledge".into(),
            Do::Leave => "leave".into(),
            Do::Width(Some(_)) => "block".into(),
            Do::Width(None) => "no block".into(),
            Do::Cut => "cut".into(),
            Do::Connect => "connect".into(),
            Do::Wait => "wait".into(),
        };
        let answer = answer.map_or_else(|error| format!(": {error}"), |()| String::new());
        writeln!(text, "  {done}{answer}").expect("a String takes all");
        for step in 0..ms / 2 {
            bench.step();
            let state = bench.state();
            let (kind, said) = match &state {
                Ok(s) => {
                    let number = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.3}"));
                    let numbers = [s.opening_mm, s.force_n, s.target_n, s.force_error_n].map(number);
                    (format!("{:?}", s.jaws), format!("{:<8} {}", format!("{:?}", s.jaws), numbers.join(" ")))
                }
                Err(error) => (error.to_string(), error.to_string()),
            };
            let events: Vec<String> = bench.events.drain(..).map(|event| event.to_string()).collect();
            sum.add(format!("{state:?}{events:?}{}", bench.driver.is_busy()).as_bytes());
            sum.add(&bench.plant.force_n.to_bits().to_le_bytes());
            let sent = bench.pair.sent.as_mut().map(std::mem::take).unwrap_or_default();
            sum.add(&sent);
            let ends = step + 1 == ms / 2;
            if kind != shown || !events.is_empty() || ends {
                let events = if events.is_empty() { String::new() } else { format!("  [{}]", events.join("; ")) };
                let (at_ms, pressed_n) = (bench.now_ns() / MS, bench.plant.force_n);
                writeln!(text, "{at_ms:6}  pressed {pressed_n:7.3}  reads {said:<42} {}{events}", sum.shown())
                    .expect("a String takes all");
            }
            shown = kind;
        }
    }
    text
}

/// The same with a lower force allowed.
fn loose(name: &str) -> Config {
    Config { lowering: Lowering::Allow, ..config(name) }
}

fn tables(name: &str, others: &[(&str, Config, &str)]) {
    let mut text = HEAD.to_owned();
    text += &table("as shipped", name, config(name), "");
    text += &table("may be loosened, late answers", name, loose(name), "late=15,allow-regrasp@0");
    text += &table(
        "a sensor with bias, gain, noise and steps; bytes lost and changed",
        name,
        loose(name),
        "bias=1.5,gain=1.1,noise=0.4,step=0.25,drop=0.01,corrupt=0.01,seed=3",
    );
    text += &table("a link that stalls and is closed", name, loose(name), "stall=700@2600,close@9000,late-every=23");
    text +=
        &table("it stops itself, its supply fails", name, config(name), "fast-stop@1500,power-cycle@6200,drift=0.2");
    text +=
        &table("the part is lost, forces are refused", name, loose(name), "refuse-force@2500,lose-part@3300,idle=0.8");
    for (title, config, faults) in others {
        text += &table(title, name, config.clone(), faults);
    }
    snapshot::check(&format!("wires/{name}.txt"), &text);
}

#[test]
fn wsg50() {
    let total = Config { force_is: ForceIs::Total, part_width_mm: None, ..loose("wsg50") };
    let limit = Config { force_change: ForceChange::Limit, ..loose("wsg50") };
    let regrasp = Config { force_change: ForceChange::Regrasp, ..loose("wsg50") };
    tables(
        "wsg50",
        &[
            ("newtons of both fingers, no width", total, ""),
            ("the limit alone, which has no effect", limit, "fixed-limit@0"),
            ("the grasp is given again", regrasp, "allow-regrasp@0"),
            ("whichever works", loose("wsg50"), "fixed-limit@2000,allow-regrasp@0"),
        ],
    );
}

#[test]
fn gcl() {
    let total = Config { force_is: ForceIs::Total, part_width_mm: None, ..loose("gcl") };
    tables("gcl", &[("newtons of both fingers, no width", total, "allow-regrasp@0")]);
}

#[test]
fn robotiq() {
    tables("robotiq", &[]);
}

#[test]
fn robotiq_rtu() {
    tables("robotiq-rtu", &[]);
}

#[test]
fn line() {
    tables("line", &[]);
}

/// The wrist of the line protocol: turned, lowered, paused, refused, cut.
#[test]
fn line_wrist() {
    let mut text = "What is asked of a wrist, and what it says then: angle, way, whether it moves.\n".to_owned();
    for faults in ["", "late=20,late-every=13", "drop=0.02,corrupt=0.02,seed=5", "close@900,stall=300@1500"] {
        writeln!(text, "\nfaults: {faults:?}").expect("a String takes all");
        let emulator = emulator::by_name("line").expect("a name").with_faults(faults.parse().expect("faults"));
        let mut plant = Block::new(WIDTH_MM);
        let mut pair = LockstepPair::new(LineWrist::new("line://bench"), emulator, &mut plant);
        pair.sent = Some(Vec::new());
        let mut sum = Checksum::new();
        for step in 0..1000u64 {
            let now_ns = pair.now_ns() + 3 * MS;
            if step % 33 == 5 {
                let motion = match step / 100 {
                    0..=2 => WristMotion::Turn { rate_rad_per_s: 0.4, most_rad: 0.05 },
                    3 | 4 => WristMotion::Lower { rate_mm_per_s: -8.0, most_mm: 1.2 },
                    5 => WristMotion::Pause,
                    6 => WristMotion::Turn { rate_rad_per_s: 90.0, most_rad: 1.0 },
                    7 => WristMotion::Lower { rate_mm_per_s: 5.0, most_mm: f64::NAN },
                    _ => WristMotion::Turn { rate_rad_per_s: -0.3, most_rad: 1.0 },
                };
                let told = pair.driver.command(now_ns, WristCommand::new(motion));
                sum.add(format!("{told:?}").as_bytes());
                if let Err(error) = told {
                    writeln!(text, "{:5}  {error}", now_ns / MS).expect("a String takes all");
                }
            }
            pair.step(now_ns, &mut plant);
            assert!(pair.exchange(), "the two never stop talking");
            plant.advance_to(now_ns);
            let said = pair.driver.report(now_ns);
            sum.add(format!("{said:?}{}", pair.driver.is_stated()).as_bytes());
            sum.add(&pair.sent.as_mut().map(std::mem::take).unwrap_or_default());
            if step % 50 == 49 {
                let said = match said {
                    Ok(s) => format!("{:.5} rad {:.4} mm {}", s.angle_rad, s.lowered_mm, s.moving),
                    Err(error) => error.to_string(),
                };
                writeln!(text, "{:5}  {said:<60} {}", now_ns / MS, sum.shown()).expect("a String takes all");
            }
        }
    }
    snapshot::check("wires/line_wrist.txt", &text);
}
