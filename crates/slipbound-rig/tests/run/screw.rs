//! A made-up run: a cap is screwed on for 10 s, and slips four times. No physics, only plausible numbers.

use slipbound::control::Cycle;
use slipbound::events::{SlipEpisodes, SlipObservation};
use slipbound::hand::{FINGERS_MOST, HandReport, HandSlip, HandVector, Health, Mounting, Side};
use slipbound::monitor::{Settings, SlipState};
use slipbound::plant::PlantTruth;
use slipbound::port::{GripCommand, GripperState, Jaws, WristCommand, WristMotion, WristState};
use slipbound::task::{Ending, Phase, TaskKind, TaskSettings};
use slipbound_rig::run::{FingerInfo, Row, RunInfo};
use slipbound_rig::sensors;

/// Cycles at which it begins to slip.
pub const SLIPS: [u32; 4] = [126, 183, 228, 264];
const RATE_HZ: f64 = 30.0;
const FRICTION: f64 = 0.6;
const CAP_RADIUS_MM: f64 = 14.0;

/// Task, controller, fingers.
pub fn info() -> RunInfo {
    RunInfo {
        name: "screw".into(),
        task: TaskKind::Screw,
        source: "cap of 28 mm, friction 0.6".into(),
        seed: 3,
        task_settings: TaskSettings::default(),
        monitor_settings: Settings::default(),
        notes: "friction = 0.6".parse().expect("TOML"),
        fingers: vec![finger("left", Side::Left), finger("right", Side::Right)],
    }
}

/// A finger of this name.
pub fn finger(name: &str, side: Side) -> FingerInfo {
    let sensor = sensors::load("gelslim").expect("built in");
    FingerInfo { name: name.into(), mounting: Mounting::on(side), sensor, rest: None }
}

/// Numbers the slips as the loop does.
pub fn numbered(mut cycles: Vec<Cycle>) -> Vec<Cycle> {
    let mut slips = SlipEpisodes::default();
    for cycle in &mut cycles {
        slips.see(&SlipObservation::of_hand(cycle.time_ns, &cycle.hand));
        cycle.slips_count = slips.count();
    }
    cycles
}

/// The table below the title.
pub fn results() -> Vec<Row> {
    let row = |name: &str, value: &str, target: &str, ok| Row {
        name: name.into(),
        value: value.into(),
        target: target.into(),
        ok,
    };
    vec![
        row("cap torque reached / limit", "0.95", ">= 0.90", Some(true)),
        row("sliding", "1.62 mm", "<= 1 mm", Some(false)),
        row("over-squeeze", "1.48", "", None),
        row("alarms", "4", "", None),
        row("time", "9.7 s", "", None),
    ]
}

/// Every cycle.
pub fn cycles() -> Vec<Cycle> {
    let (mut force_n, mut target_n, mut slid_mm, mut shear_mm, mut angle_rad) = (0.0, 10.0, 0.0, 0.0, 0.0);
    let mut alarms_count = 0;
    let mut pause = 0;
    let cycles = (0..300u32).map(|i| {
        let t_s = f64::from(i) / RATE_HZ;
        let grasping = t_s < 0.8;
        let ending = t_s > 9.7;
        let slips = SLIPS.iter().any(|&at| i == at || i == at + 1);
        if SLIPS.contains(&i) {
            alarms_count += 1;
            pause = 12;
            target_n += 10.0;
        }
        pause = (pause - 1).max(0);
        force_n += (target_n - force_n) * 0.25;
        let moving = pause == 0 && !grasping && !ending;
        angle_rad += if moving { 0.5 / RATE_HZ } else { 0.0 };
        let load = ((t_s - 3.0).max(0.0) / 6.0).powi(2);
        let torque_n_mm = 40.0 + 780.0 * load.min(1.2);
        let limit_n_mm = 2.0 * FRICTION * force_n * CAP_RADIUS_MM;
        let fraction = (torque_n_mm / limit_n_mm).min(1.1);
        slid_mm += if fraction > 0.9 && moving { 0.004 * fraction } else { 0.0 };
        shear_mm += 0.08 * (torque_n_mm / 900.0 - shear_mm);
        let noise = 0.01 * (f64::from(i) * 1.7).sin();
        let phase = match () {
            _ if grasping => Phase::Grasping,
            _ if ending => Phase::Ended(Ending::Tight),
            _ if t_s > 9.3 => Phase::Releasing,
            _ if pause > 0 => Phase::Waiting,
            _ => Phase::Working,
        };
        let mut health = [Health::Absent; FINGERS_MOST];
        health[0] = Health::Live;
        health[1] = if (5.0..5.3).contains(&t_s) { Health::Blind } else { Health::Live };
        let time_ns = (t_s * 1e9) as u64;
        let around = HandVector { along: 0.1, across: 0.0, around: 0.99 };
        Cycle {
            time_ns,
            hand: HandReport {
                seq: u64::from(i),
                time_ns: Some(time_ns),
                state: if slips { SlipState::Incipient } else { SlipState::Stick },
                live_count: 2,
                health,
                separated: true,
                shear_mm: (t_s > 0.3).then_some(HandVector {
                    along: 0.06 * t_s / 10.0 + noise,
                    across: noise,
                    around: shear_mm + noise,
                }),
                pivot_rad: Some(0.02 * noise),
                slip_max_mm: Some(0.02 + if slips { 0.3 } else { 0.0 }),
                contact_area_mm2: Some(80.0),
                quality: 0.9,
                slip: slips.then_some(HandSlip { direction: around, pivots: false, fingers_count: 2 }),
                margin: None,
                margins_count: 0,
                friction: None,
                cut_fraction: 0.0,
            },
            gripper: GripperState {
                time_ns,
                force_n: Some(force_n + 10.0 * noise),
                force_error_n: None,
                target_n: Some(target_n),
                opening_mm: Some(28.0),
                jaws: if grasping { Jaws::Closing } else { Jaws::Holding },
            },
            idle_force_n: 0.0,
            wrist: WristState { time_ns, angle_rad, lowered_mm: 0.0, moving },
            grip_command: GripCommand::Hold { force_n: target_n },
            wrist_command: WristCommand::new(match moving {
                true => WristMotion::Turn { rate_rad_per_s: 0.5, most_rad: 0.1 },
                false => WristMotion::Pause,
            }),
            phase,
            margin: (t_s > 0.8).then_some((1.0 - fraction + 6.0 * noise).clamp(0.0, 1.0)),
            alarms_count,
            truth: Some(PlantTruth {
                cap_angle_rad: Some((angle_rad - slid_mm / CAP_RADIUS_MM).max(0.0)),
                torque_n_mm: Some(torque_n_mm),
                torque_limit_n_mm: Some(2.0 * FRICTION * 60.0 * CAP_RADIUS_MM),
                required_n: Some(torque_n_mm / (2.0 * FRICTION * CAP_RADIUS_MM)),
                margin: Some(1.0 - fraction),
                stick_ratio: Some((1.0 - fraction).max(0.0).powf(2.0 / 3.0)),
                slid_mm: Some(slid_mm),
                gross: fraction > 1.0,
                ..PlantTruth::default()
            }),
            slips_count: 0,
            fault: false,
            on_fault: false,
            refused_lowering: false,
        }
    });
    numbered(cycles.collect())
}
