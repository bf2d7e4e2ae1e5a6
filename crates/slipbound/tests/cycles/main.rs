//! Tasks, controllers, guard, hand and force sense against a numerical model of a hand, cycle by cycle, to the last
//! bit, as tables beside this file. After an intended change regenerate them with
//!
//! ```text
//! REGENERATE=1 cargo test -p slipbound --test reports --test cycles
//! ```
//!
//! Review the difference before you commit it.

mod plant;
#[path = "../snapshot/mod.rs"]
mod snapshot;

use plant::{Finger, Frame, Load, Noise, Plant, STIFFNESS_MPA_PER_MM};
use slipbound::events::{Episode, EpisodeChange, SlipEpisodes, SlipEvents, SlipObservation};
use slipbound::grip::{ForceSense, GripController};
use slipbound::hand::{Hand, HandReport, Health, Mounting, Side};
use slipbound::port::{GripCommand, GripperState, Jaws, WristMotion};
use slipbound::task::{ControllerKind, Missing, Observation, Phase, TaskKind, TaskSettings, TaskStep};
use snapshot::Checksum;

const CYCLE_NS: u64 = 33_333_333;

/// Cycles before the task begins, in which the open jaws are measured.
const REST_CYCLES: u64 = 8;

const HEAD: &str = "force: as it is made of what the gripper says, N, = where it stands still; told: to the gripper. wrist: turned in rad, lowered in mm.\n\
    fingers: + live, ? blind, = frozen. shear in mm: along, across, around; pivot in rad. slip: alarms of the law, slips seen, ! one now and its way.\n\
    margin: of the hand and of the law. sum: of all that hand, law and task said so far.\n";

const TITLES: &str = "cycle phase       hand      fingers  force     told     wrist           shear                    pivot    margin          friction slip                          sum\n";

/// A task on a bench.
struct Case {
    name: &'static str,
    kind: TaskKind,
    settings: TaskSettings,
    fingers: Vec<Mounting>,
    knows_stiffness: bool,
    plant: Plant,
    mu: f64,
    /// Noise of the shear of a gel, mm.
    noise_mm: f64,
    /// From this cycle on the gripper reports that the held object is gone.
    lost_from: u64,
    /// What happens to each finger's frames from a cycle on; after the last letter all are judged.
    frames: Vec<(u64, &'static str)>,
    cycles: u64,
}

impl Case {
    fn new(name: &'static str, kind: TaskKind, controller: ControllerKind) -> Self {
        Case {
            name,
            kind,
            settings: TaskSettings::default().with_controller(controller),
            fingers: vec![Mounting::on(Side::Left), Mounting::on(Side::Right)],
            knows_stiffness: true,
            plant: Plant::new(0.0, 1.0, 0.0),
            mu: 0.7,
            noise_mm: 0.004,
            lost_from: u64::MAX,
            frames: Vec::new(),
            cycles: 420,
        }
    }

    fn with(mut self, change: impl FnOnce(&mut Case)) -> Self {
        change(&mut self);
        self
    }

    fn frame(&self, finger: usize, cycle: u64) -> Frame {
        let Some((from, letters)) = self.frames.get(finger) else { return Frame::Judged };
        let at = cycle.checked_sub(*from).and_then(|at| letters.chars().nth(at as usize));
        at.map_or(Frame::Judged, Frame::of)
    }

    fn run(mut self, load: impl Fn(&Bench) -> Load) -> String {
        let stiffness = self.knows_stiffness.then_some(STIFFNESS_MPA_PER_MM);
        let mut task = self.settings.task(self.kind, stiffness).expect("valid");
        let mut hand = Hand::new(&self.fingers).expect("a hand");
        let mut fingers: Vec<Finger> = self
            .fingers
            .iter()
            .enumerate()
            .map(|(i, &mounting)| Finger::new(mounting, i as u64 + 1, self.noise_mm))
            .collect();
        let (mut sense, mut episodes, mut events) = (ForceSense::default(), SlipEpisodes::default(), SlipEvents::new());
        let (mut sum, mut text) = (Checksum::new(), format!("\n{}\n{TITLES}", self.name));
        let mut last: Option<(Phase, Shown)> = None;
        let mut ended_count = 0;
        for cycle in 0..self.cycles {
            let now_ns = cycle * CYCLE_NS;
            self.plant.advance_to(now_ns);
            self.plant.is_lost = cycle >= self.lost_from;
            let (state, wrist) = self.plant.states(now_ns);
            if cycle < REST_CYCLES {
                sum.add(format!("{:?}", sense.rest(&state, cycle == 0)).as_bytes());
                continue;
            }
            let grip_n = self.plant.jaws.force_n();
            let bench =
                Bench { cycle, turned_rad: wrist.angle_rad, lowered_mm: wrist.lowered_mm, carries_n: self.mu * grip_n };
            let load = load(&bench);
            for (i, finger) in fingers.iter_mut().enumerate() {
                match finger.report(now_ns, self.frame(i, cycle), &load, grip_n, self.mu) {
                    Some(report) => {
                        hand.see(i, &report);
                        events.see(&report).for_each(|event| sum.add(&serde_json::to_vec(&event).expect("data")));
                    }
                    None => hand.missed(i),
                }
            }
            let report = hand.report(now_ns);
            let change = episodes.see(&SlipObservation::of_hand(now_ns, &report));
            let gripper = sense.see(now_ns, &state, true);
            let step = task.step(&Observation { now_ns, hand: &report, gripper: &gripper, wrist: &wrist });
            let guard = task.grip();
            let law = (guard.margin(), guard.alarms_count(), guard.wants_more(), guard.is_blind(), guard.force_n());
            let still = sense.is_still();
            let (change, missing) = (text_of(&change), text_of_missing(task.missing()));
            sum.add(format!("{report:?}{change}{gripper:?}{still}{step:?}{law:?}{missing}").as_bytes());
            self.plant.command(step.grip, step.wrist);
            let now = (step.phase, Shown { report, gripper, step, still, slips_count: episodes.count() });
            let is_new = last.as_ref().is_none_or(|(phase, before)| {
                *phase != now.0
                    || before.report.slip.is_some() != report.slip.is_some()
                    || before.report.health != report.health
            });
            if is_new || cycle % 12 == 0 || cycle + 1 == self.cycles {
                let law_margin = law.0.map_or("-".into(), |margin| format!("{margin:.4}"));
                text += &row(cycle, &now.1, &law_margin, law.1, (wrist.angle_rad, wrist.lowered_mm), &sum);
            }
            last = Some(now);
            ended_count += u32::from(matches!(step.phase, Phase::Ended(_)));
            if ended_count == 4 {
                break;
            }
        }
        text
    }
}

/// The variables that a load may depend on.
struct Bench {
    cycle: u64,
    turned_rad: f64,
    lowered_mm: f64,
    /// Maximum load that friction carries, N per finger.
    carries_n: f64,
}

/// What a row shows.
struct Shown {
    report: HandReport,
    gripper: GripperState,
    step: TaskStep,
    still: bool,
    slips_count: u32,
}

fn row(cycle: u64, shown: &Shown, law_margin: &str, alarms: u32, (rad, mm): (f64, f64), sum: &Checksum) -> String {
    let Shown { report, gripper, step, still, slips_count } = shown;
    let phase = match step.phase {
        Phase::Ended(ending) => format!("{ending:?}"),
        other => format!("{other:?}").to_lowercase(),
    };
    let letter = |health: &Health| match health {
        Health::Absent => ' ',
        Health::Live => '+',
        Health::Blind => '?',
        Health::Frozen => '=',
    };
    let told = match step.grip {
        GripCommand::Hold { force_n } => format!("{force_n:.4}"),
        GripCommand::Release => "release".into(),
    };
    let wrist = match step.wrist.motion {
        WristMotion::Pause => "pause",
        WristMotion::Turn { .. } => "turn",
        WristMotion::Lower { .. } => "lower",
    };
    let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.4}"));
    let shear = report.shear_mm.map_or("-".into(), |s| format!("{:7.4} {:7.4} {:7.4}", s.along, s.across, s.around));
    let slip = report.slip.map_or(String::new(), |slip| {
        let d = slip.direction;
        let pivots = if slip.pivots { " pivots" } else { "" };
        format!("!{} {:.2} {:.2} {:.2}{pivots}", slip.fingers_count, d.along, d.across, d.around)
    });
    let health: String = report.health.iter().map(letter).collect();
    format!(
        "{cycle:4}  {phase:<11} {:<9} {health:<7} {:>8}{} {told:>8}  {wrist:<5} {rad:6.3} {mm:6.2}  {shear:<23} {:>8}  {:>7} {law_margin:>7} {:>8}  {alarms} {slips_count} {slip:<26} {}\n",
        format!("{:?}", report.state).to_lowercase(),
        number(gripper.force_n),
        if *still { '=' } else { ' ' },
        number(report.pivot_rad),
        number(report.margin),
        number(report.friction),
        sum.shown(),
    )
}

/// A cap that turns freely for a while and then becomes tight.
fn tightens(bench: &Bench) -> Load {
    let around_n = (38.0 * (bench.turned_rad - 0.35)).max(0.4);
    Load { along_n: 0.2, around_n: around_n.min(bench.carries_n), ..Load::default() }
}

/// A cap on a soft washer: its torque levels off without ever becoming constant.
fn tightens_slowly(bench: &Bench) -> Load {
    let around_n = 24.0 * (1.0 - libm::exp(-6.0 * (bench.turned_rad - 0.1).max(0.0)));
    Load { around_n: around_n.min(bench.carries_n), ..Load::default() }
}

/// A cap that holds until its torque is reached, or forever.
fn opens_at(most_n: f64) -> impl Fn(&Bench) -> Load {
    move |bench| {
        let wanted_n = -60.0 * bench.turned_rad;
        let around_n = if wanted_n > most_n { 0.15 * most_n } else { wanted_n };
        Load { along_n: 0.1, around_n: -around_n.min(bench.carries_n), ..Load::default() }
    }
}

/// A bottle that hangs as soon as it is lifted, and is filled.
fn fills(bench: &Bench) -> Load {
    let hangs = (-bench.lowered_mm / 3.0).clamp(0.0, 1.0);
    let poured_n = 0.03 * bench.cycle.saturating_sub(110).min(160) as f64;
    let along_n = (hangs * (1.2 + poured_n)).min(1.02 * bench.carries_n);
    let across_n = if bench.cycle % 90 > 80 { 0.8 } else { 0.05 };
    Load { along_n, across_n, ..Load::default() }
}

/// A tool that touches the ground after 4 mm, turns as it is laid down, and lies after 7.
fn touches(bench: &Bench) -> Load {
    let down_mm = bench.lowered_mm;
    let pivot_rad = 0.012 * (down_mm - 4.0).clamp(0.0, 3.0);
    let push_n = 0.5 * (down_mm - 7.0).max(0.0);
    Load { along_n: 0.9 - push_n, pivot_rad, ..Load::default() }
}

#[test]
fn screwing() {
    use ControllerKind::{Constant, Margin, OnSlip, Paper};
    let turned = Mounting { side: Side::Right, turn_rad: 0.3 };
    let mut text = HEAD.to_owned();
    text += &Case::new("step at each slip, a clean force", TaskKind::Screw, OnSlip).run(tightens);
    text += &Case::new("the paper's law, a sensor that reads 12 % more", TaskKind::Screw, Paper)
        .with(|case| (case.plant, case.mu) = (Plant::new(1.5, 1.12, 0.0), 0.5))
        .run(tightens);
    text += &Case::new("margin, a noisy sensor, three fingers of which one is turned", TaskKind::Screw, Margin)
        .with(|case| {
            case.plant = Plant::new(-2.0, 0.93, 0.9);
            case.fingers.push(turned);
            case.frames = vec![(60, "...tt...ffffff....____"), (90, "uuuuuuu...nnnn"), (70, "llllll....ccc")];
        })
        .run(tightens);
    text += &Case::new("one force, one finger, nobody knows the stiffness", TaskKind::Screw, Constant)
        .with(|case| {
            case.fingers.truncate(1);
            case.knows_stiffness = false;
        })
        .run(tightens);
    text += &Case::new("step at each slip, a noisy gel, a cap on a soft washer", TaskKind::Screw, OnSlip)
        .with(|case| {
            (case.settings.grip.most_n, case.mu, case.noise_mm) = (30.0, 0.9, 0.03);
        })
        .run(tightens_slowly);
    text += &Case::new("margin, a noisy gel, slid round a cap on a soft washer", TaskKind::Screw, Margin)
        .with(|case| (case.settings.grip.most_n, case.mu, case.noise_mm) = (20.0, 0.6, 0.02))
        .run(tightens_slowly);
    snapshot::check("cycles/screw.txt", &text);
}

#[test]
fn unscrewing() {
    use ControllerKind::{Constant, Margin, OnSlip};
    let mut text = HEAD.to_owned();
    text += &Case::new("step at each slip", TaskKind::Unscrew, OnSlip).run(opens_at(14.0));
    text += &Case::new("margin, of a cap that holds for ever", TaskKind::Unscrew, Margin)
        .with(|case| case.settings.grip.most_n = 25.0)
        .run(opens_at(1e9));
    text += &Case::new("one force that is too little", TaskKind::Unscrew, Constant).run(opens_at(30.0));
    text += &Case::new("margin, one finger, slippery", TaskKind::Unscrew, Margin)
        .with(|case| {
            case.fingers.truncate(1);
            (case.mu, case.frames) = (0.35, vec![(80, "aaa...mmm....uuuuuuuuuuuu")]);
        })
        .run(opens_at(9.0));
    snapshot::check("cycles/unscrew.txt", &text);
}

#[test]
fn lifting() {
    use ControllerKind::{Constant, Margin, OnSlip};
    let mut text = HEAD.to_owned();
    text += &Case::new("step at each slip, frames of all kinds", TaskKind::Lift, OnSlip)
        .with(|case| {
            (case.settings.lift.hold_ns, case.mu) = (5_000_000_000, 0.45);
            case.frames = vec![(80, "tttt.......ffffffff...llll.cccc"), (80, "t__t.uu....ffffffff........llllllll")];
        })
        .run(fills);
    text += &Case::new("margin, a noisy force, a blind hand goes to 22 N", TaskKind::Lift, Margin)
        .with(|case| {
            (case.plant, case.mu) = (Plant::new(2.5, 1.08, 0.5), 0.6);
            case.settings.grip = case.settings.grip.with_blind_force_n(Some(22.0));
            case.settings.lift.hold_ns = 6_000_000_000;
            case.frames = vec![(150, "______...uuuuu..nnnnn"), (150, "______...uuuuu..nnnnn")];
        })
        .run(fills);
    text += &Case::new("one force; the object is lost", TaskKind::Lift, Constant)
        .with(|case| (case.mu, case.lost_from) = (0.2, 150))
        .run(|bench| Load { along_n: (0.05 * bench.cycle as f64).min(bench.carries_n), ..Load::default() });
    text += &Case::new("nothing between the jaws", TaskKind::Lift, OnSlip)
        .with(|case| case.plant.is_empty = true)
        .run(|_| Load::default());
    text += &Case::new("lost from the start", TaskKind::Lift, Margin)
        .with(|case| (case.lost_from, case.cycles) = (0, 60))
        .run(|_| Load::default());
    snapshot::check("cycles/lift.txt", &text);
}

#[test]
fn laying_down() {
    use ControllerKind::{Constant, Margin, OnSlip};
    let mut text = HEAD.to_owned();
    text += &Case::new("one force", TaskKind::Place, Constant).run(touches);
    text += &Case::new("step at each slip, slippery, nobody knows the stiffness", TaskKind::Place, OnSlip)
        .with(|case| (case.knows_stiffness, case.mu) = (false, 0.25))
        .run(touches);
    text += &Case::new("margin, frames of all kinds", TaskKind::Place, Margin)
        .with(|case| case.frames = vec![(110, "___....tttt...mmm.uuu"), (112, "_t_....___")])
        .run(touches);
    text += &Case::new("no ground", TaskKind::Place, OnSlip)
        .with(|case| case.settings.place.most_mm = 15.0)
        .run(|_| Load { along_n: 0.9, ..Load::default() });
    text += &Case::new("jaws that do not loosen", TaskKind::Place, Constant)
        .with(|case| case.plant.jaws = Plant::jaws(10.0))
        .run(touches);
    snapshot::check("cycles/place.txt", &text);
}

/// Corrected forces for commands of 10, 25, 14 and 40 N, for various sensors.
#[test]
fn readings_of_a_force() {
    let mut text =
        "Cycle, what the gripper read and what it is taken for, N, = where it stands still; sum: of all so far.\n"
            .to_owned();
    for (bias_n, gain, noise_n, error_n) in [
        (0.0, 1.0, 0.0, None),
        (3.0, 0.85, 0.0, None),
        (-2.0, 1.15, 0.15, None),
        (0.5, 1.04, 0.6, Some(1.0)),
        (6.0, 1.0, 2.5, Some(4.0)),
        (9.0, 0.4, 0.0, None),
    ] {
        text += &format!(
            "\nbias {bias_n} gain {gain} noise {noise_n}, stated error {error_n:?}; idle goes when it presses: {}\n",
            bias_n > 8.0
        );
        let (mut sense, mut noise, mut sum) = (ForceSense::default(), Noise::new(5), Checksum::new());
        let mut force_n = 0.0;
        for cycle in 0..330u64 {
            let (target_n, jaws) = match cycle {
                0..40 => (10.0, Jaws::Open),
                40..50 => (10.0, Jaws::Closing),
                50..130 => (10.0, Jaws::Holding),
                130..200 => (25.0, Jaws::Holding),
                200..250 => (14.0 + 0.02 * (cycle - 200) as f64, Jaws::Holding),
                250..310 => (40.0, Jaws::Holding),
                _ => (40.0, Jaws::Lost),
            };
            let goes_for_n = if jaws == Jaws::Holding { target_n } else { 0.0 };
            force_n += 0.35 * (goes_for_n - force_n);
            let bias_n = if bias_n > 8.0 && jaws == Jaws::Holding { 0.0 } else { bias_n };
            let read_n = force_n * gain + bias_n + noise_n * noise.next();
            let state = GripperState {
                // Some readings arrive twice, one is missing.
                time_ns: (cycle - u64::from(cycle % 11 == 3)) * CYCLE_NS,
                force_n: (cycle != 77).then_some(read_n),
                force_error_n: error_n,
                target_n: Some(target_n),
                opening_mm: None,
                jaws,
            };
            let told = sense.see(cycle * CYCLE_NS, &state, cycle >= 40);
            sum.add(format!("{told:?} {} {}", sense.is_still(), sense.idle_n()).as_bytes());
            if cycle % 10 == 9 {
                let still = if sense.is_still() { '=' } else { ' ' };
                let told_n = told.force_n.unwrap_or(f64::NAN);
                text += &format!(
                    "{cycle:3} {read_n:8.4} {told_n:8.4}{still} idle {:.4}  {}\n",
                    sense.idle_n(),
                    sum.shown()
                );
            }
        }
    }
    snapshot::check("cycles/force.txt", &text);
}

/// The slips that a cycle ends and begins, for the checksums: as they were first kept, whatever the types are called.
fn text_of(change: &EpisodeChange) -> String {
    let slip = |slip: Option<Episode>| {
        slip.map_or("None".into(), |Episode { number, first, last, frames_count }| {
            let (first, last) = ((first.seq, first.time_ns), (last.seq, last.time_ns));
            let frames = format!("first: {first:?}, last: {last:?}, frames_count: {frames_count}");
            format!("Some(Episode {{ number: {number}, {frames} }})")
        })
    };
    format!("Change {{ ended: {}, began: {} }}", slip(change.ended), slip(change.began))
}

/// The same of what a task waits for.
fn text_of_missing(missing: Option<Missing>) -> String {
    missing.map_or("None".into(), |missing| match missing {
        Missing::SteadyGrip => "Some(Rest)".into(),
        other => format!("Some({other:?})"),
    })
}
