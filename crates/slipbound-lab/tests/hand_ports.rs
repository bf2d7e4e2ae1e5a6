//! The simulated hand through its ports: scenes as text, cameras, gripper, wrist, and the plant for external drivers.

use slipbound::control::{CycleObserver, CycleView};
use slipbound::monitor::Settings;
use slipbound::plane::Vec2;
use slipbound::plant::{JawCommand, JawDrive, JawSettings, Plant};
use slipbound::port::{FrameBuffer, FrameSource, GripCommand, Gripper, Jaws, Next, Wrist, WristCommand, WristMotion};
use slipbound::task::TaskSettings;
use slipbound_lab::faults::{Faults, Faulty};
use slipbound_lab::hand::{HAND_TASKS, HandScene, SimCamera, SimGripper, SimHand, SimPlant, SimWrist};
use slipbound_lab::lockstep::LockStep;
use slipbound_lab::objects::OBJECTS;

const DEG: f64 = std::f64::consts::PI / 180.0;

fn hand(scene: &str) -> SimHand {
    SimHand::new(&HandScene::parse(scene).expect("a sound scene")).expect("a sound hand")
}

fn hold(force_n: f64) -> GripCommand {
    GripCommand::Hold { force_n }
}

#[test]
fn cameras_see_the_same_twist_and_a_scene_is_the_same_bytes() {
    let run = |scene: &str| {
        let hand = SimHand::new(&HandScene::parse(scene).expect("a sound scene")).expect("a sound hand");
        let (mut left, mut right) = (hand.camera(0), hand.camera(1));
        let (mut gripper, mut wrist) = (hand.gripper(), hand.wrist());
        let (mut frame, mut bytes, mut jaws) = (FrameBuffer::default(), [Vec::new(), Vec::new()], Vec::new());
        for n in 0..24u64 {
            if n == 2 {
                gripper.command(GripCommand::Hold { force_n: 15.0 }).expect("taken over");
            }
            if n > 12 {
                let motion = WristMotion::Turn { rate_rad_per_s: 20.0 * DEG, most_rad: 0.1 };
                wrist.command(WristCommand::new(motion)).expect("taken over");
            }
            assert_eq!(left.next(&mut frame).expect("a frame"), Next::Frame);
            assert_eq!(left.next(&mut FrameBuffer::default()).expect("an answer"), Next::Silent);
            assert_eq!((frame.seq, frame.time_ns), (n, Some(hand.now_ns())));
            bytes[0].extend_from_slice(&frame.encoded);
            assert_eq!(right.next(&mut frame).expect("a frame"), Next::Frame);
            bytes[1].extend_from_slice(&frame.encoded);
            jaws.push(gripper.poll().expect("a state"));
            hand.advance_frame();
        }
        assert_eq!((jaws[0].jaws, jaws[23].jaws), (Jaws::Open, Jaws::Holding));
        assert!((jaws[23].force_n.expect("a force") - 15.0).abs() < 0.2, "{:?}", jaws[23]);
        let shift = |finger: usize| {
            let shifts = hand.marker_shifts_mm(finger);
            shifts.iter().fold(0.0f64, |most, shift| if shift.y.abs() > most.abs() { shift.y } else { most })
        };
        (bytes, [shift(0), shift(1)])
    };
    let (bytes, shifts) = run("screw?run_n_mm=1e6&seed=3");
    assert!(shifts[0] > 0.2 && (shifts[0] / shifts[1] - 1.0).abs() < 0.05, "{shifts:?}");
    assert!(bytes[0] != bytes[1], "two fingers have markers and noise of their own");
    assert!(run("screw?run_n_mm=1e6&seed=3").0 == bytes);
    assert!(run("screw?run_n_mm=1e6&seed=4").0[0] != bytes[0]);
}

#[test]
fn a_pull_down_goes_the_same_way_in_both_pictures_and_a_turn_the_other() {
    // A tool held off its middle turns about the closing direction: the fingers see it from its two sides.
    let hand = hand("place?off_mm=20");
    hand.gripper().command(hold(10.0)).expect("taken over");
    for _ in 0..30 {
        hand.advance_frame();
    }
    let mean = |finger: usize| {
        let shifts = hand.marker_shifts_mm(finger);
        let sum = shifts.iter().fold([0.0, 0.0], |sum, shift| [sum[0] + shift.x, sum[1] + shift.y.abs()]);
        sum.map(|sum| sum / shifts.len() as f64)
    };
    let [left, right] = [mean(0), mean(1)];
    assert!(left[0] > 1e-3 && (left[0] / right[0] - 1.0).abs() < 0.1, "{left:?} {right:?}");
    let curl = |finger: usize| {
        let shifts = hand.marker_shifts_mm(finger);
        let columns = 29;
        let (middle, row) = (shifts.len() / 2 + columns / 2, columns);
        // Difference of y along x and of x along y, over the middle of the pad.
        (shifts[middle + 2].y - shifts[middle - 2].y) - (shifts[middle + 2 * row].x - shifts[middle - 2 * row].x)
    };
    assert!(curl(0) * curl(1) < 0.0, "{} {}", curl(0), curl(1));
}

#[test]
fn a_tilted_tool_is_seen_from_its_two_sides_and_a_cap_alike() {
    // Markers are in 20 rows of 21; row r of one finger is row 19 - r of the other if that one sees the mirror image.
    for (scene, mirrored) in [("place?tilt_deg=30", true), ("screw?thread_mm_per_turn=8&seal_deg=2", false)] {
        let hand = hand(scene);
        hand.gripper().command(hold(15.0)).expect("taken over");
        let mut wrist = hand.wrist();
        for n in 0..45 {
            let turn = WristMotion::Turn { rate_rad_per_s: 20.0 * DEG, most_rad: 1.0 };
            wrist.command(WristCommand::new(if n < 20 { WristMotion::Pause } else { turn })).expect("taken over");
            hand.advance_frame();
        }
        let (left, right) = (hand.marker_shifts_mm(0), hand.marker_shifts_mm(1));
        assert_eq!((left.len(), right.len()), (580, 580));
        let apart = |mirror: bool| {
            let of = |n: usize| {
                let seen = right[if mirror { (19 - n / 29) * 29 + n % 29 } else { n }];
                if mirror { Vec2::new(seen.x, -seen.y) } else { seen }
            };
            (0..580).map(|n| (left[n] - of(n)).length()).sum::<f64>()
        };
        let (so, otherwise) = (apart(mirrored), apart(!mirrored));
        assert!(so < 0.3 * otherwise, "{scene}: {so} mm, otherwise {otherwise} mm");
    }
}

#[test]
fn scenes_are_text_and_what_they_cannot_be_is_refused_by_name() {
    for (task, _, _) in HAND_TASKS {
        let scene = HandScene::parse(&format!("{task}?mu=0.61&seed=7&fingers=1")).expect("a sound scene");
        assert_eq!((scene.task(), scene.mu(), scene.seed(), scene.fingers_count()), (task, 0.61, 7, 1));
        assert_eq!(HandScene::parse(&scene.to_string()).expect("its own text"), scene);
    }
    assert_eq!(HandScene::parse("screw").expect("a sound scene").mu(), 0.75, "the cap's own");
    for (text, expected) in [
        ("pour", "task: expected one of screw, unscrew, place, lift, got pour"),
        ("screw?mu=3", "mu: expected a number from 0.05 to 2, or `object`, got 3"),
        ("screw?fingers=3", "fingers: expected a whole number from 1 to 2, got 3"),
        ("screw?seed=-1", "seed: expected a whole number from 0 to 9007199254740992, got -1"),
        ("screw?object=spoon", "object: expected one of tape_roll"),
        ("screw?object=scissors", "object: expected something round, for the task screw, got scissors"),
        ("screw?tilt_deg=3", "parameter of the task screw: expected one of seed, object, mu"),
        ("unscrew?break_n_mm=open", "break_n_mm: expected a number from 0 to 1000000, or `closed`, got open"),
        ("lift?fill_kg_per_s=-1", "fill_kg_per_s: expected a number from 0 to 2, or `seed`, got -1"),
        ("lift?mu", "mu: expected key=value, got no value"),
        ("lift?mu=NaN", "mu: expected a number"),
        ("place?fault=drop", "fault: expected"),
    ] {
        let error = HandScene::parse(text).expect_err(text).to_string();
        assert!(error.starts_with(expected), "{text}: {error}");
    }
}

#[test]
fn every_object_can_be_lifted_and_put_down_and_round_ones_turned() {
    for object in &OBJECTS {
        for task in ["lift", "place", "unscrew"] {
            let text = format!("{task}?object={}&fingers=1", object.name);
            let Ok(scene) = HandScene::parse(&text) else {
                assert_eq!(task, "unscrew", "{text}: {}", HandScene::parse(&text).expect_err("refused"));
                continue;
            };
            let hand = SimHand::new(&scene).expect("a sound hand");
            hand.gripper().command(hold(10.0)).expect("taken over");
            for _ in 0..6 {
                hand.advance_frame();
            }
            assert_eq!(hand.error(), None, "{text}");
            assert!(hand.truth().grip_force_n > 5.0 && !hand.truth().gross, "{text}: {:?}", hand.truth());
        }
    }
}

#[test]
fn commands_that_cannot_be_are_refused_and_change_nothing() {
    let hand = hand("screw?fingers=1");
    let (mut gripper, mut wrist) = (hand.gripper(), hand.wrist());
    gripper.command(hold(20.0)).expect("taken over");
    for _ in 0..40 {
        hand.advance_frame();
    }
    for force_n in [f64::NAN, f64::INFINITY, -1.0] {
        let error = gripper.command(hold(force_n)).expect_err("refused").to_string();
        assert!(error.contains("expected a finite force of 0 N or above, got"), "{error}");
    }
    let spin = WristCommand::new(WristMotion::Turn { rate_rad_per_s: f64::NAN, most_rad: 1.0 });
    assert!(wrist.command(spin).expect_err("refused").to_string().contains("got turn at NaN rad/s"));
    for _ in 0..10 {
        hand.advance_frame();
    }
    let state = gripper.poll().expect("a state");
    assert!((state.force_n.expect("a force") - 20.0).abs() < 0.01 && state.target_n == Some(20.0), "{state:?}");
    assert_eq!(wrist.poll().expect("a state").angle_rad, 0.0);
    // Releasing opens wide, and closing on nothing reaches the cap again.
    gripper.command(GripCommand::Release).expect("taken over");
    for _ in 0..60 {
        hand.advance_frame();
    }
    let state = gripper.poll().expect("a state");
    assert_eq!((state.jaws, state.force_n, state.opening_mm), (Jaws::Open, Some(0.0), Some(110.0)), "{state:?}");
    assert_eq!(hand.truth().stick_ratio, None, "nothing touches");
}

#[test]
fn a_bottle_that_fell_is_lost() {
    let hand = hand("lift?start_kg=1.5&mu=0.3&fingers=1");
    let (mut gripper, mut wrist) = (hand.gripper(), hand.wrist());
    gripper.command(hold(5.0)).expect("taken over");
    for _ in 0..60 {
        let up = WristMotion::Lower { rate_mm_per_s: -30.0, most_mm: 50.0 };
        if gripper.poll().expect("a state").jaws == Jaws::Holding {
            wrist.command(WristCommand::new(up)).expect("taken over");
        }
        hand.advance_frame();
    }
    let truth = hand.truth();
    let bottle = truth.bottle.expect("a bottle");
    assert!(bottle.dropped && truth.slid_mm > 15.0 && truth.first_gross_ns.is_some(), "{truth:?}");
    assert_eq!((truth.grip_force_n, truth.stick_ratio, truth.gross), (0.0, None, false));
    assert_eq!(gripper.poll().expect("a state").jaws, Jaws::Lost);
}

#[test]
fn cameras_end_with_the_scene_and_faults_pass_through_them() {
    let hand = hand("screw?longest_s=0.5");
    let faults = Faults::parse("drop=0.3,late=0.2").expect("sound faults");
    let (mut whole, mut faulty) = (hand.camera(0), Faulty::new(hand.camera(1), faults, 1));
    let (mut frame, mut came, mut silent) = (FrameBuffer::default(), 0, 0);
    for n in 0..16 {
        assert_eq!(whole.next(&mut frame).expect("a frame"), Next::Frame, "{n}");
        match faulty.next(&mut frame).expect("an answer") {
            Next::Frame => came += 1,
            Next::Silent => silent += 1,
            other => panic!("{other:?}"),
        }
        hand.advance_frame();
    }
    assert!(came >= 5 && silent >= 3, "{came} {silent}");
    assert_eq!(whole.next(&mut frame).expect("an answer"), Next::End);
    let error = hand.camera(2).next(&mut frame);
    assert_eq!(error.expect("over, whoever asks"), Next::End);
    assert!(self::hand("screw?fingers=1").camera(1).next(&mut frame).is_err(), "no camera there");
}

#[test]
fn the_gel_of_a_sensor_is_known() {
    let sensor = hand("screw").sensor(0);
    let stiffness = sensor.shear_stiffness_mpa_per_mm().expect("known");
    // G / h = 0.5 MPa / (2 (1 + 0.485)) / 3 mm.
    assert!((stiffness - 0.5 / 2.97 / 3.0).abs() < 1e-12, "{stiffness}");
    sensor.check().expect("sound");
}

#[test]
fn a_plant_driven_by_somebody_else_shows_and_tells_the_same() {
    let own = hand("screw?fingers=1&seed=2");
    own.gripper().command(hold(15.0)).expect("taken over");
    let other = hand("screw?fingers=1&seed=2");
    let mut plant = other.plant();
    let mut jaws = JawDrive::new(JawSettings { stroke_mm: 32.0, ..JawSettings::default() }).expect("valid");
    jaws.command(JawCommand::Grasp { force_n: 15.0 });
    let (mut a, mut b) = (FrameBuffer::default(), FrameBuffer::default());
    for n in 1..=12u64 {
        own.advance_frame();
        other.advance_frame(); // does nothing: an external driver advances the time
        for step in 4 * (n - 1) + 1..=4 * n {
            let to_ns = (step * 1_000_000_000 + 60) / 120;
            jaws.advance_to(to_ns, plant.width_mm());
            plant.press(jaws.force_n());
            plant.advance_to(to_ns);
        }
        assert_eq!(own.camera(0).next(&mut a).expect("a frame"), Next::Frame);
        assert_eq!(other.camera(0).next(&mut b).expect("a frame"), Next::Frame);
        assert_eq!((a.seq, a.time_ns, a.encoded == b.encoded), (n, b.time_ns, true));
    }
    assert!(other.truth().grip_force_n > 10.0 && other.truth().opening_mm.is_none());
    assert!(other.gripper().command(hold(1.0)).is_err());
}

/// A hand whose parts are all owned by their own threads makes the same bytes as one in lock-step on one thread: only
/// the order of the calls matters, and channels keep it here.
#[test]
fn every_part_of_a_hand_can_be_owned_by_a_thread() {
    const fn is_send<T: Send>() {}
    const _: () = {
        is_send::<SimHand>();
        is_send::<SimCamera>();
        is_send::<SimGripper>();
        is_send::<SimWrist>();
        is_send::<SimPlant>();
    };
    let scene = "screw?seed=2";
    let turn = WristCommand::new(WristMotion::Turn { rate_rad_per_s: 20.0 * DEG, most_rad: 0.1 });
    let run = |parts: &mut dyn FnMut(&SimHand) -> [Vec<u8>; 2]| {
        let hand = hand(scene);
        for _ in 0..14 {
            hand.advance_frame();
        }
        let bytes = parts(&hand);
        (bytes, hand.truth())
    };
    let alone = run(&mut |hand| {
        let (mut frame, mut bytes) = (FrameBuffer::default(), [Vec::new(), Vec::new()]);
        let (mut gripper, mut wrist, mut cameras) = (hand.gripper(), hand.wrist(), [hand.camera(0), hand.camera(1)]);
        for _ in 0..20 {
            gripper.command(hold(15.0)).expect("taken over");
            wrist.command(turn).expect("taken over");
            for (camera, bytes) in cameras.iter_mut().zip(&mut bytes) {
                assert_eq!(camera.next(&mut frame).expect("a frame"), Next::Frame);
                bytes.extend_from_slice(&frame.encoded);
            }
            hand.advance_frame();
        }
        bytes
    });
    let apart = run(&mut |hand| {
        // All parts do a round at once; the barrier lets time advance only between rounds.
        let barrier = std::sync::Barrier::new(5);
        let (mut gripper, mut wrist) = (hand.gripper(), hand.wrist());
        let cameras = [hand.camera(0), hand.camera(1)];
        let round = |part: &mut dyn FnMut()| {
            for _ in 0..20 {
                part();
                barrier.wait();
                barrier.wait();
            }
        };
        std::thread::scope(|scope| {
            let round = &round;
            scope.spawn(move || round(&mut || gripper.command(hold(15.0)).expect("taken over")));
            scope.spawn(move || round(&mut || wrist.command(turn).expect("taken over")));
            let cameras = cameras.map(|mut camera| {
                scope.spawn(move || {
                    let (mut frame, mut bytes) = (FrameBuffer::default(), Vec::new());
                    round(&mut || {
                        assert_eq!(camera.next(&mut frame).expect("a frame"), Next::Frame);
                        bytes.extend_from_slice(&frame.encoded);
                    });
                    bytes
                })
            });
            let hand = hand.clone();
            let barrier = &barrier;
            scope.spawn(move || {
                for _ in 0..20 {
                    barrier.wait();
                    hand.advance_frame();
                    barrier.wait();
                }
            });
            cameras.map(|camera| camera.join().expect("no panic"))
        })
    });
    assert!(alone.0 == apart.0 && alone.1 == apart.1);
    assert!(alone.1.grip_force_n > 10.0, "{:?}", alone.1);
    // The plant, too, for an emulated gripper.
    let mut plant = hand(scene).plant();
    let thread = std::thread::spawn(move || {
        plant.advance_to(100_000_000);
        plant.width_mm()
    });
    assert_eq!(thread.join().expect("no panic"), Some(28.0));
}

/// Contact areas reported by the hand: number of cycles with an area but no force, and the last area, mm2.
#[derive(Default)]
struct Told {
    untouched_count: u32,
    last_mm2: f64,
}

impl CycleObserver for Told {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        let Some(cycle) = view.cycle() else { return };
        let Some(area_mm2) = cycle.hand.contact_area_mm2 else { return };
        self.untouched_count += u32::from(cycle.gripper.force_n.is_some_and(|force_n| force_n < 0.1));
        self.last_mm2 = area_mm2;
    }
}

/// Edge thresholds scale with the image size: those for 480 rows would report contact on bare weave of 320 rows.
#[test]
fn pictures_of_another_size_show_the_same_contact() {
    let told = |height_px: u32| {
        let scene = format!("lift?seed=21&fingers=1&mu=0.9&longest_s=1.5&height_px={height_px}");
        let scene = HandScene::parse(&scene).expect("a sound scene");
        let mut run = LockStep::new(&scene, &TaskSettings::default(), &Settings::default(), None).expect("a hand");
        let mut told = Told::default();
        run.run(&|| false, &mut told).expect("runs to its end");
        assert_eq!(run.hand().sensor(0).image_px.height, height_px as usize);
        assert_eq!(told.untouched_count, 0, "{height_px} rows: contact without a touch");
        told.last_mm2
    };
    let usual_mm2 = told(480);
    for height_px in [320, 400, 720] {
        let share = told(height_px) / usual_mm2;
        assert!((0.9..=1.05).contains(&share), "{height_px} rows: {share} of the contact");
    }
}
