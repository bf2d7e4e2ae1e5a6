//! The control loop driven with user-defined camera, gripper, wrist and observer, without simulator and rig.

mod picture;

use picture::{Painter, Touch, frame};
use slipbound::control::{ControlError, ControlLoop, CycleObserver, CycleOutcome, CycleView, FaultKind};
use slipbound::finger_pipeline::FingerPipeline;
use slipbound::hand::{Health, Mounting, Side};
use slipbound::image::SizePx;
use slipbound::monitor::{RestBuilder, RestError, RestKind, Settings, SlipRule};
use slipbound::plane::Vec2;
use slipbound::port::{
    Clock, DriverEvent, FrameBuffer, FrameSource, GripCommand, Gripper, GripperError, GripperErrorKind, GripperState,
    Jaws, Next, PixelFormat, SourceError, SourceErrorKind, Wrist, WristCommand, WristError, WristErrorKind,
    WristMotion, WristState,
};
use slipbound::sensor::Skin;
use slipbound::task::{ControllerKind, Phase, TaskKind, TaskSettings};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const FRAME_NS: u64 = 33_333_333;
const SIZE: SizePx = SizePx::new(640, 480);
const PITCH_PX: f64 = 24.0;
const MIDDLE: Vec2 = Vec2::new(320.0, 240.0);

/// Contact state of the finger in a frame.
#[derive(Clone, Copy)]
enum Scene {
    Dark,
    Open,
    /// Held; the rim of the contact lags behind the object by this many px.
    Held(f64),
    Torn,
    Silent,
    Unplugged,
}

/// A camera that paints its frames: of each scene a few with different noise, which it then gives in turn.
struct Camera {
    painter: Painter,
    scenes: VecDeque<Scene>,
    seq: u64,
    painted: BTreeMap<(Option<u64>, u64), Vec<u8>>,
}

/// Pictures of one scene.
const PICTURES_COUNT: u64 = 8;

impl Camera {
    fn new(painter: Painter, scenes: impl IntoIterator<Item = Scene>) -> Self {
        Camera { painter, scenes: scenes.into_iter().collect(), seq: 0, painted: BTreeMap::new() }
    }

    /// The object moves along x and drags the gel in contact, but the rim lags; without a lag there is no object.
    fn paint(&mut self, lag_px: Option<f64>) -> &[u8] {
        let noise = self.seq % PICTURES_COUNT;
        let painter = &self.painter;
        self.painted.entry((lag_px.map(f64::to_bits), noise)).or_insert_with(|| {
            let at = |x_px| Touch {
                centre: MIDDLE + Vec2::new(x_px, 0.0),
                radii_px: Vec2::new(6.5, 5.5) * PITCH_PX,
                strength_levels: 32.0,
            };
            let moved_px = |p: Vec2| lag_px.map_or(0.0, |px| 1.2 * px - if at(0.0).depth(p) > 0.72 { px } else { 0.0 });
            let dots: Vec<Vec2> = painter.rest.iter().map(|&p| p + Vec2::new(moved_px(p), 0.0)).collect();
            painter.paint(&dots, lag_px.map(|px| at(1.2 * px)).as_ref(), noise)
        })
    }
}

impl FrameSource for Camera {
    fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
        let Some(scene) = self.scenes.pop_front() else { return Ok(Next::End) };
        (into.seq, into.time_ns, into.clock) = (self.seq, Some(self.seq * FRAME_NS), Clock::Device);
        self.seq += 1;
        let lag_px = match scene {
            Scene::Dark | Scene::Open => None,
            Scene::Held(lag_px) => Some(lag_px),
            Scene::Silent => return Ok(Next::Silent),
            Scene::Torn => return Ok(Next::Torn { reason: "cut off".into() }),
            Scene::Unplugged => return Err(SourceError::new(SourceErrorKind::Disconnected, "my camera: unplugged")),
        };
        into.pixels.clear();
        into.pixels.extend_from_slice(self.paint(lag_px));
        if matches!(scene, Scene::Dark) {
            into.pixels.fill(0);
        }
        (into.format, into.size) = (PixelFormat::Rgb, self.painter.sensor.image_px);
        Ok(Next::Frame)
    }
}

/// A gripper that executes commands at once, and fails on request.
#[derive(Default)]
struct MyGripper {
    command: Option<GripCommand>,
    is_lost: bool,
    refuses_lowering: bool,
    /// Maximum force that it exerts, N; None: any commanded force.
    most_n: Option<f64>,
    is_silent_on_force: bool,
    /// What it reports of its jaws and their opening instead, and from which command on and before which.
    reports: Option<(Jaws, Option<f64>, std::ops::Range<usize>)>,
    commands: Vec<GripCommand>,
    events: Vec<DriverEvent>,
}

impl Gripper for MyGripper {
    fn command(&mut self, command: GripCommand) -> Result<(), GripperError> {
        let before_n = self.command.and_then(|c| c.force_n()).unwrap_or(0.0);
        if self.refuses_lowering && command.force_n().is_some_and(|n| n < before_n) {
            return Err(GripperError::new(GripperErrorKind::Lowering, "not lower while holding"));
        }
        self.commands.push(command);
        self.command = Some(command);
        Ok(())
    }

    fn poll(&mut self) -> Result<GripperState, GripperError> {
        if self.is_lost {
            return Err(GripperError::new(GripperErrorKind::Link, "cable out"));
        }
        let force_n = self.command.and_then(|c| c.force_n());
        let (jaws, opening_mm) = match &self.reports {
            Some((jaws, mm, during)) if during.contains(&self.commands.len()) => (*jaws, *mm),
            _ if force_n.is_some() => (Jaws::Holding, Some(28.0)),
            _ => (Jaws::Open, Some(100.0)),
        };
        let pressed_n = force_n.map(|n| n.min(self.most_n.unwrap_or(n)));
        Ok(GripperState {
            time_ns: 0,
            force_n: pressed_n.filter(|_| !self.is_silent_on_force),
            force_error_n: None,
            target_n: force_n.filter(|_| !self.is_silent_on_force),
            opening_mm,
            jaws,
        })
    }

    fn next_event(&mut self) -> Option<DriverEvent> {
        self.events.pop()
    }
}

/// The commands received, and whether the link is lost.
#[derive(Default)]
struct MyWrist(Vec<WristMotion>, bool);

impl Wrist for MyWrist {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        self.0.push(command.motion);
        Ok(())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        if self.1 {
            return Err(WristError::new(WristErrorKind::Link, "cable out"));
        }
        Ok(WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: 0.0, moving: false })
    }
}

/// Records what it is shown, one word per cycle.
#[derive(Default)]
struct Diary {
    words: Vec<&'static str>,
    events: Vec<DriverEvent>,
    slips: Vec<u64>,
    rest_kind: Option<RestKind>,
    /// Idle reading of the gripper's force in the first and in the last cycle with a command, N.
    idle_n: Option<(f64, f64)>,
}

impl CycleObserver for Diary {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        self.words.push(match view.outcome {
            None => "left",
            Some(CycleOutcome::FindingRest) => "rest",
            Some(CycleOutcome::Waiting) => "waiting",
            Some(CycleOutcome::SourceEnded) => "end",
            Some(CycleOutcome::Commanded(cycle)) => match cycle.phase {
                Phase::Grasping => "grasping",
                Phase::Ended(_) => "ended",
                _ => "working",
            },
        });
        if let Some(cycle) = view.cycle()
            && cycle.slips_count as usize > self.slips.len()
        {
            self.slips.push(cycle.hand.seq);
        }
        if let Some(now_n) = view.cycle().map(|cycle| cycle.idle_force_n) {
            self.idle_n = Some((self.idle_n.map_or(now_n, |(first_n, _)| first_n), now_n));
        }
        self.events.extend(view.driver_events.iter().cloned());
        self.rest_kind = view.fingers[0].rest_kind;
    }
}

fn control(scenes: impl IntoIterator<Item = Scene>, settings: &TaskSettings) -> ControlLoop {
    control_with(Skin::Smooth, scenes, settings)
}

fn control_with(skin: Skin, scenes: impl IntoIterator<Item = Scene>, task: &TaskSettings) -> ControlLoop {
    let painter = Painter::new(SIZE, PITCH_PX, 8.0, skin, 0.5, 11);
    let sensor = painter.sensor.clone();
    let camera = Camera::new(painter, scenes);
    let mounting = Mounting::on(Side::Left);
    // Markers decide, because a painted rim follows no contact physics.
    let settings = Settings::default().with(|s| s.slip.rule = SlipRule::Markers);
    let finger = FingerPipeline::new("left", mounting, sensor, settings, Box::new(camera));
    ControlLoop::new(vec![finger], task.task(TaskKind::Lift, None).expect("valid")).expect("a hand")
}

fn hold() -> TaskSettings {
    TaskSettings::default().with(|s| (s.lift.lift_mm, s.lift.hold_ns) = (0.0, 60_000_000_000))
}

fn scenes(parts: &[(usize, Scene)]) -> Vec<Scene> {
    parts.iter().flat_map(|&(count, scene)| std::iter::repeat_n(scene, count)).collect()
}

/// Runs until the source ends, or until an error.
fn run(
    control: &mut ControlLoop,
    gripper: &mut MyGripper,
    wrist: &mut MyWrist,
    diary: &mut Diary,
) -> Option<ControlError> {
    for cycle in 0.. {
        match control.cycle(cycle * FRAME_NS, gripper, wrist, diary) {
            Ok(CycleOutcome::SourceEnded) => return None,
            Ok(_) => {}
            Err(error) => return Some(error),
        }
    }
    None
}

#[test]
fn a_users_camera_and_gripper_hold_harder_when_the_rim_slips() {
    let parts = [(20, Scene::Open), (20, Scene::Held(0.0)), (3, Scene::Held(9.0)), (12, Scene::Held(9.0))];
    let mut control = control(scenes(&parts), &hold());
    let (mut gripper, mut wrist, mut diary) = (MyGripper::default(), MyWrist::default(), Diary::default());
    gripper.events.push(DriverEvent::Linked);
    assert!(run(&mut control, &mut gripper, &mut wrist, &mut diary).is_none());
    assert_eq!(diary.words.iter().filter(|word| **word == "rest").count(), 19, "{:?}", diary.words);
    assert_eq!(diary.rest_kind, Some(RestKind::Unloaded));
    assert_eq!(diary.slips, [40], "the rim slips once");
    assert_eq!(diary.events, [DriverEvent::Linked]);
    assert_eq!(gripper.command, Some(GripCommand::Hold { force_n: 20.0 }));
    assert_eq!(diary.words.last(), Some(&"end"));
}

#[test]
fn a_lost_gripper_is_waited_for_with_the_wrist_paused_and_frames_judged() {
    let parts = [(20, Scene::Open), (30, Scene::Held(0.0))];
    let mut control = control(scenes(&parts), &hold());
    let (mut gripper, mut wrist, mut diary) = (MyGripper::default(), MyWrist::default(), Diary::default());
    for cycle in 0..50 {
        gripper.is_lost = (35..40).contains(&cycle);
        let outcome = control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut diary).expect("goes on");
        assert_eq!(outcome == CycleOutcome::Waiting, gripper.is_lost, "cycle {cycle}");
        assert!(cycle < 20 || control.fingers()[0].report().is_some(), "cycle {cycle} was judged");
        if gripper.is_lost {
            assert_eq!(wrist.0.last(), Some(&WristMotion::Pause));
        }
    }
    assert!(gripper.commands.iter().all(|c| c.force_n() >= Some(10.0)), "{:?}", gripper.commands);
    assert!(control.fault().is_none() || diary.words.len() == 50);
}

#[test]
fn an_unplugged_camera_ends_the_loop_with_the_wrist_paused_and_the_force_kept() {
    let parts =
        [(20, Scene::Open), (20, Scene::Held(0.0)), (1, Scene::Torn), (3, Scene::Held(0.0)), (1, Scene::Unplugged)];
    let mut control = control(scenes(&parts), &hold());
    let (mut gripper, mut wrist, mut diary) = (MyGripper::default(), MyWrist::default(), Diary::default());
    let error = run(&mut control, &mut gripper, &mut wrist, &mut diary).expect("unplugged");
    let ControlError::Source { finger, source } = &error else { panic!("{error}") };
    assert_eq!((finger.as_str(), source.kind), ("left", SourceErrorKind::Disconnected));
    assert_eq!(error.to_string(), "left: my camera: unplugged");
    assert_eq!((diary.words.last(), wrist.0.last()), (Some(&"left"), Some(&WristMotion::Pause)));
    assert_eq!(gripper.command, Some(GripCommand::Hold { force_n: 10.0 }));
}

/// Making a monitor takes many frame periods. A frame of the other finger acquired after it would be newer, which would
/// look like an offset between the cameras' clocks.
#[test]
fn the_first_frames_of_all_fingers_are_taken_before_the_monitor_of_one_is_made() {
    struct Counted(Camera, Arc<AtomicUsize>);
    impl FrameSource for Counted {
        fn next(&mut self, into: &mut FrameBuffer) -> Result<Next, SourceError> {
            self.1.fetch_add(1, Ordering::Relaxed);
            self.0.next(into)
        }
    }
    let given: [Arc<AtomicUsize>; 2] = Default::default();
    let finger = |(side, name, rest_px, pitch_px), given: &Arc<AtomicUsize>| {
        let of_rest = Painter::new(rest_px, pitch_px, pitch_px / 3.0, Skin::Smooth, 0.5, 11);
        let mut rest = RestBuilder::new(&of_rest.sensor, &Settings::default(), rest_px).expect("valid");
        rest.add(&frame(&of_rest.paint(&of_rest.rest, None, 0), rest_px, 0)).expect("bright");
        let rest = rest.build(RestKind::Unloaded).expect("markers");
        let painter = Painter::new(SIZE, PITCH_PX, 8.0, Skin::Smooth, 0.5, 11);
        let sensor = painter.sensor.clone();
        let camera = Counted(Camera::new(painter, scenes(&[(9, Scene::Open)])), given.clone());
        FingerPipeline::new(name, Mounting::on(side), sensor, Settings::default(), Box::new(camera)).with_rest(rest)
    };
    // A rest frame of another size ends the loop when the monitor of the left finger would be made.
    let hand = [(Side::Left, "left", SizePx::new(320, 240), 16.0), (Side::Right, "right", SIZE, PITCH_PX)];
    let fingers = hand.into_iter().zip(&given).map(|(of, given)| finger(of, given)).collect();
    let mut control = ControlLoop::new(fingers, hold().task(TaskKind::Lift, None).expect("valid")).expect("a hand");
    let (mut gripper, mut wrist, mut diary) = (MyGripper::default(), MyWrist::default(), Diary::default());
    let error = control.cycle(0, &mut gripper, &mut wrist, &mut diary).expect_err("another size").to_string();
    assert!(error.contains("left") && error.contains("rest.size"), "{error}");
    assert_eq!(given.map(|count| count.load(Ordering::Relaxed)), [1, 1]);
}

#[test]
fn a_finger_that_starts_in_contact_says_so() {
    let mut control = control_with(Skin::Fabric, scenes(&[(22, Scene::Held(0.0))]), &hold());
    let (mut gripper, mut wrist, mut diary) = (MyGripper::default(), MyWrist::default(), Diary::default());
    assert!(run(&mut control, &mut gripper, &mut wrist, &mut diary).is_none());
    assert_eq!(diary.rest_kind, Some(RestKind::InContact));
}

#[test]
fn a_gripper_that_refuses_a_lower_force_is_no_fault() {
    let mut settings = hold();
    (settings.on_slip.step_n, settings.grip.start_n) = (-4.0, 20.0);
    let parts = [(20, Scene::Open), (20, Scene::Held(0.0)), (6, Scene::Held(9.0))];
    let mut control = control(scenes(&parts), &settings);
    let mut gripper = MyGripper { refuses_lowering: true, ..MyGripper::default() };
    let (mut wrist, mut diary) = (MyWrist::default(), Diary::default());
    assert!(run(&mut control, &mut gripper, &mut wrist, &mut diary).is_none());
    assert_eq!(gripper.command, Some(GripCommand::Hold { force_n: 20.0 }));
    assert!(control.fault().is_none() && !diary.slips.is_empty());
}

/// An object that a run before this one left with 50 N, and a gripper that lowers its force when it is told to.
#[test]
fn what_the_gripper_holds_already_is_not_loosened_to_the_starting_force() {
    for (most_n, first_n) in [(60.0, 50.0), (30.0, 30.0)] {
        let mut settings = hold();
        settings.grip.most_n = most_n;
        let mut control = control(scenes(&[(20, Scene::Open), (9, Scene::Held(0.0))]), &settings);
        let (mut wrist, mut diary) = (MyWrist::default(), Diary::default());
        let mut gripper = MyGripper { command: Some(GripCommand::Hold { force_n: 50.0 }), ..MyGripper::default() };
        assert!(run(&mut control, &mut gripper, &mut wrist, &mut diary).is_none());
        assert!(gripper.commands.len() > 5);
        assert!(gripper.commands.iter().all(|told| told.force_n() == Some(first_n)), "{:?}", gripper.commands);
    }
}

/// The fingers feel it from their first frame on: they take the loaded gel for the unloaded one.
#[test]
fn what_is_held_already_is_not_loosened_by_fingers_that_start_in_contact() {
    let mut control = control_with(Skin::Fabric, scenes(&[(50, Scene::Held(0.0))]), &hold());
    let (mut wrist, mut diary) = (MyWrist::default(), Diary::default());
    let mut gripper = MyGripper { command: Some(GripCommand::Hold { force_n: 30.0 }), ..MyGripper::default() };
    assert!(run(&mut control, &mut gripper, &mut wrist, &mut diary).is_none());
    assert_eq!((diary.words.last(), diary.rest_kind), (Some(&"end"), Some(RestKind::InContact)));
    assert!(diary.words.iter().filter(|word| **word == "working").count() > 15, "{:?}", diary.words);
    assert!(gripper.commands.iter().all(|told| told.force_n() == Some(30.0)), "{:?}", gripper.commands);
}

/// After an acknowledged fast stop a gripper presses on and reports open jaws until it is told to grasp.
#[test]
fn what_open_jaws_press_already_is_not_loosened() {
    for kind in [ControllerKind::OnSlip, ControllerKind::Margin, ControllerKind::Constant] {
        let mut settings = hold().with_controller(kind);
        settings.margin.stiffness_mpa_per_mm = 0.05;
        let mut control = control_with(Skin::Fabric, scenes(&[(90, Scene::Held(0.0))]), &settings);
        let (mut wrist, mut diary) = (MyWrist::default(), Diary::default());
        let command = Some(GripCommand::Hold { force_n: 40.0 });
        let mut gripper = MyGripper { command, reports: Some((Jaws::Open, Some(28.0), 0..6)), ..MyGripper::default() };
        assert!(run(&mut control, &mut gripper, &mut wrist, &mut diary).is_none());
        assert!(diary.words.iter().filter(|word| **word == "working").count() > 30, "{kind:?}: {:?}", diary.words);
        assert!(gripper.commands.iter().all(|told| told.force_n() == Some(40.0)), "{kind:?}: {:?}", gripper.commands);
        // The first frame was judged with the reading as an idle one, and so it is in a replay.
        assert_eq!(diary.idle_n, Some((40.0, 0.0)), "{kind:?}");
    }
}

#[test]
fn what_is_held_already_with_an_untold_force_is_not_touched() {
    let mut control = control(scenes(&[(20, Scene::Open), (9, Scene::Held(0.0))]), &hold());
    let (mut wrist, mut diary) = (MyWrist::default(), Diary::default());
    let command = Some(GripCommand::Hold { force_n: 30.0 });
    let mut gripper = MyGripper { command, is_silent_on_force: true, ..MyGripper::default() };
    let error = run(&mut control, &mut gripper, &mut wrist, &mut diary).expect("refused");
    assert!(matches!(error, ControlError::HeldForceUnknown), "{error}");
    assert!(gripper.commands.is_empty(), "{:?}", gripper.commands);
}

#[test]
fn a_silent_camera_makes_its_finger_blind_until_it_speaks_again() {
    let parts = [(20, Scene::Open), (3, Scene::Held(0.0)), (2, Scene::Silent), (2, Scene::Held(0.0))];
    let mut control = control(scenes(&parts), &hold());
    let (mut gripper, mut wrist) = (MyGripper::default(), MyWrist::default());
    for cycle in 0..27 {
        let outcome = control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).expect("goes on");
        let expected = if (23..25).contains(&cycle) { Health::Blind } else { Health::Live };
        assert!(outcome.commanded().is_none_or(|c| c.hand.health[0] == expected), "cycle {cycle}: {outcome:?}");
        assert!(cycle < 20 || outcome.commanded().is_some());
    }
}

#[test]
fn with_the_wrist_lost_the_grip_is_commanded_on_and_the_fault_is_cleared_after_half_a_second() {
    let mut settings = hold();
    settings.lift.lift_mm = 20.0;
    let mut control = control(scenes(&[(20, Scene::Open), (90, Scene::Held(0.0))]), &settings);
    let (mut gripper, mut wrist) = (MyGripper::default(), MyWrist::default());
    let moves = |cycle| (60..65).contains(&cycle) || cycle > 83;
    for cycle in 0..110 {
        wrist.1 = (65..68).contains(&cycle);
        let told_count = wrist.0.len();
        let outcome = control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).expect("goes on");
        assert!(cycle < 20 || outcome.commanded().is_some(), "cycle {cycle}");
        // The last fault is that of cycle 67; half a second is just over 15 cycles.
        let expected = (65..83).contains(&cycle).then_some(FaultKind::Wrist(WristErrorKind::Link));
        assert_eq!(control.fault().map(|fault| fault.kind), expected, "cycle {cycle}");
        let is_told_to_move = wrist.0[told_count..].iter().any(|motion| *motion != WristMotion::Pause);
        assert!(cycle < 60 || cycle == 83 || is_told_to_move == moves(cycle), "cycle {cycle}: from the first cycle on");
        let recorded = outcome.commanded().map(|cycle| cycle.wrist_command.motion);
        assert!(cycle < 20 || recorded == wrist.0.get(told_count).copied(), "cycle {cycle}: {recorded:?}");
    }
}

/// A wrist that accepts every motion and stands, as with its brakes on.
#[test]
fn a_wrist_that_never_moves_is_a_fault_after_a_second_and_a_half() {
    let mut settings = hold();
    settings.lift.lift_mm = 20.0;
    let mut control = control(scenes(&[(20, Scene::Open), (80, Scene::Held(0.0))]), &settings);
    let (mut gripper, mut wrist, mut diary) = (MyGripper::default(), MyWrist::default(), Diary::default());
    assert!(run(&mut control, &mut gripper, &mut wrist, &mut diary).is_none());
    assert_eq!(control.fault().map(|fault| fault.kind), Some(FaultKind::WristStands));
    let moves_count = wrist.0.iter().filter(|motion| **motion != WristMotion::Pause).count();
    assert!((45..=47).contains(&moves_count), "commanded for a second and a half: {moves_count}");
    assert!(wrist.0.iter().rev().take(40).all(|motion| *motion == WristMotion::Pause), "{:?}", wrist.0);
    assert_eq!(gripper.command, Some(GripCommand::Hold { force_n: 10.0 }));
}

/// A wrist that moves as it is told, and the motions.
#[derive(Default)]
struct Lifts(f64, Vec<WristMotion>);

impl Wrist for Lifts {
    fn command(&mut self, command: WristCommand) -> Result<(), WristError> {
        if let WristMotion::Lower { rate_mm_per_s, .. } = command.motion {
            self.0 += rate_mm_per_s * FRAME_NS as f64 * 1e-9;
        }
        self.1.push(command.motion);
        Ok(())
    }

    fn poll(&mut self) -> Result<WristState, WristError> {
        Ok(WristState { time_ns: 0, angle_rad: 0.0, lowered_mm: self.0, moving: true })
    }
}

/// Jaws that have met nothing yet would close with the blind force after the loop has been left.
#[test]
fn who_leaves_a_grasp_presses_harder_only_where_the_jaws_may_hold() {
    let mut settings = hold();
    settings.grip.blind_force_n = Some(30.0);
    for (jaws, force_n) in [(Jaws::Open, 10.0), (Jaws::Closing, 10.0), (Jaws::Holding, 30.0)] {
        let mut control = control(scenes(&[(90, Scene::Open)]), &settings);
        let mut gripper = MyGripper { reports: Some((jaws, Some(50.0), 1..usize::MAX)), ..MyGripper::default() };
        for cycle in 0..40 {
            control.cycle(cycle * FRAME_NS, &mut gripper, &mut Lifts::default(), &mut ()).expect("goes on");
        }
        assert_eq!(gripper.commands.last().map(GripCommand::force_n), Some(Some(10.0)), "it grasps");
        control.leave(&mut gripper, &mut Lifts::default());
        assert_eq!(gripper.commands.last().map(GripCommand::force_n), Some(Some(force_n)), "{jaws:?}");
    }
}

/// Another program opens the jaws while they lift, or they close further; what is reported from the 30th command on.
#[test]
fn jaws_that_hold_no_more_are_a_fault_and_are_not_closed_again_once_they_have_opened() {
    let mut settings = hold();
    (settings.lift.lift_mm, settings.grip.blind_force_n) = (200.0, Some(30.0));
    // The last: number of commands after which none follows.
    for (jaws, opening_mm, fault_after, last_command) in [
        (Jaws::Open, Some(28.0), 46, None),
        (Jaws::Open, Some(60.0), 0, Some(30)),
        (Jaws::Open, None, 46, Some(30 + 46)),
        (Jaws::Closing, Some(27.0), 46, None),
    ] {
        let mut control = control(scenes(&[(20, Scene::Open), (90, Scene::Held(0.0))]), &settings);
        let mut gripper = MyGripper { reports: Some((jaws, opening_mm, 30..usize::MAX)), ..MyGripper::default() };
        let (mut wrist, mut began, mut faulted) = (Lifts::default(), None, None);
        for cycle in 0..105 {
            let told_count = wrist.1.len();
            if gripper.commands.len() == 30 {
                began.get_or_insert(cycle);
            }
            control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).expect("goes on");
            if control.fault().is_some_and(|fault| fault.kind == FaultKind::HoldEnded) {
                faulted.get_or_insert(cycle);
            }
            let moves = wrist.1[told_count..].iter().any(|motion| *motion != WristMotion::Pause);
            let pauses = if jaws == Jaws::Open { began } else { faulted };
            assert!(
                (cycle < 45) || moves == pauses.is_none(),
                "{jaws:?} {opening_mm:?}: cycle {cycle}, moves: {moves}"
            );
        }
        assert_eq!(faulted.zip(began).map(|(at, from)| at - from), Some(fault_after), "{jaws:?} {opening_mm:?}");
        assert!(gripper.commands.iter().all(|told| told.force_n() == Some(10.0)), "{:?}", gripper.commands);
        let commands_count = gripper.commands.len();
        assert!(last_command.map_or(commands_count > 80, |last| commands_count == last), "{commands_count}");
        let error = control.cycle(105 * FRAME_NS + 10_000_000_000, &mut gripper, &mut wrist, &mut ());
        let error = error.expect_err("it is left").to_string();
        assert!(error.contains(&format!("expected jaws that hold, got {}", jaws.name())), "{error}");
        let last_n = gripper.commands.last().and_then(GripCommand::force_n);
        let blind_n = if last_command.is_some() { 10.0 } else { 30.0 };
        assert_eq!(last_n, Some(blind_n), "the blind force, for what may be held");
    }
}

/// By a gripper that does not tell how far they are open.
#[test]
fn jaws_that_opened_while_the_link_was_lost_are_not_closed_again() {
    let mut control = control(scenes(&[(20, Scene::Open), (60, Scene::Held(0.0))]), &hold());
    let (mut gripper, mut wrist, mut commands_count) = (MyGripper::default(), MyWrist::default(), None);
    for cycle in 0..70 {
        gripper.is_lost = (40..43).contains(&cycle);
        if cycle == 43 {
            gripper.reports = Some((Jaws::Open, None, 0..usize::MAX));
            commands_count = Some(gripper.commands.len());
        }
        control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).expect("goes on");
    }
    assert_eq!(Some(gripper.commands.len()), commands_count);
    assert_eq!(control.fault().map(|fault| fault.kind), Some(FaultKind::HoldEnded));
}

#[test]
fn jaws_that_somebody_opened_and_closed_on_the_object_again_keep_their_force() {
    let mut control = control(scenes(&[(20, Scene::Open), (120, Scene::Held(0.0))]), &hold());
    let reports = Some((Jaws::Open, Some(60.0), 30..31));
    let (mut gripper, mut wrist) = (MyGripper { reports, ..MyGripper::default() }, MyWrist::default());
    for cycle in 0..130 {
        match cycle {
            80 => gripper.reports = Some((Jaws::Closing, Some(40.0), 30..31)),
            85 => (gripper.reports, gripper.command) = (None, Some(GripCommand::Hold { force_n: 40.0 })),
            _ => {}
        }
        assert!(
            !(60..=85).contains(&cycle) || gripper.commands.len() == 30,
            "cycle {cycle}: {}",
            gripper.commands.len()
        );
        control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).expect("goes on");
    }
    assert!(control.fault().is_none());
    let (before, after) = gripper.commands.split_at(30);
    assert!(before.iter().all(|told| told.force_n() == Some(10.0)) && after.len() > 30);
    // Lowered slowly, as any force that the controller has not asked for, and only while nothing slips.
    let forces_n: Vec<f64> = after.iter().filter_map(GripCommand::force_n).collect();
    assert!(forces_n[0] > 39.8 && forces_n.windows(2).all(|two| two[0] - two[1] < 5.1 / 30.0), "{after:?}");
}

/// The force of that grasp is not told.
#[test]
fn an_object_that_somebody_grasped_again_with_an_untold_force_is_not_touched() {
    let mut control = control(scenes(&[(20, Scene::Open), (120, Scene::Held(0.0))]), &hold());
    let reports = Some((Jaws::Open, Some(60.0), 60..61));
    let mut gripper = MyGripper { reports, is_silent_on_force: true, ..MyGripper::default() };
    let mut wrist = MyWrist::default();
    let told = (0..130).find_map(|cycle| {
        if cycle == 100 {
            gripper.reports = None;
        }
        control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).err()
    });
    assert!(matches!(told, Some(ControlError::HeldForceUnknown)), "{told:?}");
    assert_eq!(gripper.commands.len(), 60);
}

#[test]
fn a_force_that_stays_short_is_a_fault_after_a_second_and_a_half() {
    let mut control = control(scenes(&[(20, Scene::Open), (60, Scene::Held(0.0))]), &hold());
    let mut gripper = MyGripper { most_n: Some(5.0), ..MyGripper::default() };
    let mut wrist = MyWrist::default();
    for cycle in 0..80 {
        control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).expect("goes on");
        let is_fault = control.fault().is_some_and(|fault| fault.kind == FaultKind::ForceShortfall);
        assert_eq!(is_fault, cycle >= 20 + 1 + 45, "cycle {cycle}: 10 N asked for from 20 on, seen from 21 on");
    }
}

/// The end of a time, or of the source: with a force that stays short it is the fault that has ended the work.
#[test]
fn work_whose_time_is_over_with_a_fault_has_ended_by_the_fault() {
    for (hold_s, most_n, is_fault) in [(1, 5.0, true), (60, 5.0, true), (1, 60.0, false)] {
        let mut settings = hold();
        settings.lift.hold_ns = hold_s * 1_000_000_000;
        let mut control = control(scenes(&[(20, Scene::Open), (70, Scene::Held(0.0))]), &settings);
        let mut gripper = MyGripper { most_n: Some(most_n), ..MyGripper::default() };
        let mut wrist = MyWrist::default();
        let case = format!("{hold_s} s, {most_n} N");
        for cycle in 0..=90 {
            let outcome = control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut ()).expect("goes on");
            assert_eq!(outcome == CycleOutcome::SourceEnded, cycle == 90, "{case}: cycle {cycle}");
            let has_ended = outcome.has_ended();
            match outcome.is_over(control.fault()) {
                Ok(is_over) => assert!(is_over == (has_ended || cycle == 90) && !(is_over && is_fault), "{case}"),
                Err(ControlError::Fault { fault, waited_ns: 0 }) => {
                    assert!((has_ended || cycle == 90) && fault.kind == FaultKind::ForceShortfall, "{case}: {fault}");
                }
                Err(error) => panic!("{case}: {error}"),
            }
            assert_eq!(outcome.commanded().is_some_and(|c| c.ending().is_some()), has_ended && !is_fault, "{case}");
            assert!(hold_s == 60 || cycle < 86 || cycle == 90 || has_ended, "{case}: held to its end");
        }
    }
}

#[test]
fn a_hand_whose_fingers_are_all_on_one_side_is_refused() {
    let finger = |side: Side, name: &str| {
        let painter = Painter::new(SIZE, PITCH_PX, 8.0, Skin::Smooth, 0.5, 11);
        let sensor = painter.sensor.clone();
        let camera = Camera::new(painter, []);
        FingerPipeline::new(name, Mounting::on(side), sensor, Settings::default(), Box::new(camera))
    };
    let made = |second| {
        let task = hold().task(TaskKind::Lift, None).expect("valid");
        ControlLoop::new(vec![finger(Side::Left, "a"), finger(second, "b")], task).map(drop)
    };
    assert_eq!(made(Side::Right), Ok(()));
    assert_eq!(made(Side::Left).expect_err("one side").key, "fingers[1].side");
}

/// A camera whose light comes on late: why nothing begins is shown until it does.
#[test]
fn dark_frames_are_no_rest_frame_and_an_observer_is_shown_why() {
    #[derive(Default)]
    struct Why(Vec<Option<RestError>>);
    impl CycleObserver for Why {
        fn after_cycle(&mut self, view: &CycleView<'_>) {
            self.0.push(view.fingers[0].rest_error.cloned());
        }
    }
    let mut control = control(scenes(&[(25, Scene::Dark), (20, Scene::Open)]), &hold());
    let (mut gripper, mut wrist, mut why) = (MyGripper::default(), MyWrist::default(), Why::default());
    for cycle in 0..45 {
        let outcome = control.cycle(cycle * FRAME_NS, &mut gripper, &mut wrist, &mut why).expect("goes on");
        // The window that begins with five dark frames has fifteen others.
        assert_eq!(outcome.commanded().is_some(), cycle >= 39, "cycle {cycle}");
    }
    let dark = RestError::NoStationaryFrame { looked_at_count: 20, unusable_count: 20 };
    let shown: Vec<bool> = why.0.iter().map(|error| *error == Some(dark.clone())).collect();
    assert_eq!(shown, (0..45).map(|cycle| (19..39).contains(&cycle)).collect::<Vec<_>>());
}
