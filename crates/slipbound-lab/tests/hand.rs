//! The simulated hand against statics: caps, and later bottles and tools, held by two soft fingers.

#[allow(unused_imports)]
use slipbound::port::{
    FrameBuffer, FrameSource, GripCommand, Gripper, Jaws, Motion, Next, Plant, Wrist, WristCommand, WristMotion,
};
use slipbound_lab::hand::{HandScene, HandTruth, HandWorld, SimHand};

const DEG: f64 = std::f64::consts::PI / 180.0;

fn world(scene: &str) -> HandWorld {
    HandWorld::new(&HandScene::parse(scene).expect("a sound scene")).expect("a sound world")
}

/// A world that somebody presses and moves at will, in steps of 1/120 s.
struct Bench {
    world: HandWorld,
    steps: u64,
    angle_rad: f64,
    lowered_mm: f64,
    force_n: f64,
}

impl Bench {
    fn new(scene: &str) -> Self {
        Bench { world: world(scene), steps: 0, angle_rad: 0.0, lowered_mm: 0.0, force_n: 0.0 }
    }

    fn run(&mut self, seconds_s: f64, rate_rad_per_s: f64, rate_mm_per_s: f64, force_to_n: f64) -> &HandTruth {
        let steps = (seconds_s * 120.0).round();
        let force_step_n = (force_to_n - self.force_n) / steps;
        for _ in 0..steps as u64 {
            self.steps += 1;
            self.angle_rad += rate_rad_per_s / 120.0;
            self.lowered_mm += rate_mm_per_s / 120.0;
            self.force_n = (self.force_n + force_step_n).max(0.0);
            self.world.press(self.force_n);
            self.world.place_wrist(self.angle_rad, self.lowered_mm);
            self.world.advance_to((self.steps * 1_000_000_000).div_ceil(120));
            assert_eq!(self.world.error(), None);
        }
        self.world.truth()
    }

    fn press(&mut self, force_n: f64) -> &HandTruth {
        self.run(0.3, 0.0, 0.0, force_n);
        self.run(0.2, 0.0, 0.0, force_n)
    }
}

#[test]
fn a_free_cap_follows_the_wrist_against_its_running_torque() {
    let mut bench = Bench::new("screw?mu=0.6&seal_deg=400&stop_deg=400&thread_mm_per_turn=0");
    bench.press(20.0);
    let rate = 20.0 * DEG;
    let truth = bench.run(1.5, rate, 0.0, 20.0).clone();
    let cap = truth.cap.expect("a cap");
    println!("{truth:?}");
    assert!((cap.torque_n_mm - 45.0).abs() < 0.5, "40 N mm and 5 of the viscous term: {}", cap.torque_n_mm);
    let behind_mm = 14.0 * (truth.angle_rad - cap.angle_rad);
    assert!((0.0..0.2).contains(&behind_mm), "{behind_mm} mm");
    assert!(cap.yields && !truth.gross && truth.slid_mm == 0.0);
    // It never springs back: the wrist turns back, the cap stands.
    let back = bench.run(0.2, -rate, 0.0, 20.0).cap.expect("a cap");
    assert!((back.angle_rad - cap.angle_rad).abs() < 1e-3 && back.torque_n_mm < 0.0, "{back:?}");
}

#[test]
fn a_blocked_cap_saturates_at_two_mu_p_r_and_then_slides_as_the_wrist_turns() {
    for (mu, force_n) in [(0.6, 20.0), (0.4, 40.0)] {
        let mut bench = Bench::new(&format!("screw?mu={mu}&run_n_mm=1e6"));
        bench.press(force_n);
        bench.run(0.5, 20.0 * DEG, 0.0, force_n);
        let before = bench.run(0.5, 20.0 * DEG, 0.0, force_n).clone();
        let after = bench.run(1.0, 20.0 * DEG, 0.0, force_n).clone();
        let (cap, limit_n_mm) = (after.cap.expect("a cap"), 2.0 * mu * force_n * 14.0);
        println!("{before:?}\n{after:?}");
        assert!((cap.limit_n_mm / limit_n_mm - 1.0).abs() < 0.01);
        assert!((cap.torque_n_mm / limit_n_mm - 1.0).abs() < 0.02, "{} of {limit_n_mm}", cap.torque_n_mm);
        assert!(after.gross && !cap.yields && cap.angle_rad == 0.0);
        assert!((after.required_n / force_n - 1.0).abs() < 0.02, "{}", after.required_n);
        let way_mm = 14.0 * 20.0 * DEG;
        let slid_mm = after.slid_mm - before.slid_mm;
        assert!((slid_mm / way_mm - 1.0).abs() < 0.02, "{slid_mm} mm of {way_mm} mm");
    }
}

#[test]
fn a_cap_screws_home_as_far_as_friction_turns_it() {
    // Through run, seal and stop: T = 40 + 600 (phi - 60 deg) + 12000 (phi - 75 deg), which friction carries up to
    // 2 mu P R. The way along the thread is followed by the hand, as by a wrist that knows it.
    for (mu, force_n) in [(0.6, 20.0), (0.9, 40.0)] {
        let mut bench = Bench::new(&format!("screw?mu={mu}"));
        bench.press(force_n);
        let truth = bench.run(6.0, 20.0 * DEG, 3.0 * 20.0 / 360.0, force_n).clone();
        let cap = truth.cap.expect("a cap");
        let limit_n_mm = 2.0 * mu * force_n * 14.0;
        let home_rad = 75.0 * DEG + (limit_n_mm - 40.0 - 600.0 * 15.0 * DEG) / 12_600.0;
        println!("{cap:?} {home_rad} {limit_n_mm} {} {:?}", truth.slid_mm, truth.wrench[0]);
        assert!((cap.angle_rad - home_rad).abs() < 0.1 * DEG, "{} of {home_rad}", cap.angle_rad);
        assert!(truth.gross && cap.torque_n_mm <= limit_n_mm);
    }
}

#[test]
fn a_cap_breaks_loose_just_when_two_mu_p_r_is_more_than_holds_it() {
    for (mu, force_n) in [(0.6, 20.0), (0.8, 30.0)] {
        let limit_n_mm = 2.0 * mu * force_n * 14.0;
        for (share, loose) in [(0.98, true), (1.02, false)] {
            let break_n_mm = share * limit_n_mm;
            let mut bench = Bench::new(&format!("unscrew?mu={mu}&break_n_mm={break_n_mm}&thread_mm_per_turn=0"));
            bench.press(force_n);
            let truth = bench.run(1.5, -20.0 * DEG, 0.0, force_n);
            let cap = truth.cap.expect("a cap");
            println!("{share} {cap:?}");
            assert_eq!(cap.angle_rad > 2.0 * DEG, loose, "{share}: {cap:?}");
            assert!(loose || cap.angle_rad == 0.0, "{cap:?}");
            assert!(!loose || (cap.torque_n_mm - 45.0).abs() < 3.0, "{cap:?}");
        }
    }
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
                gripper.command(GripCommand { force_n: 15.0, motion: Motion::Go }).expect("taken over");
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
    println!("{shifts:?}");
    assert!(shifts[0] > 0.2 && (shifts[0] / shifts[1] - 1.0).abs() < 0.05, "{shifts:?}");
    assert!(bytes[0] != bytes[1], "two fingers have markers and noise of their own");
    assert!(run("screw?run_n_mm=1e6&seed=3").0 == bytes);
    assert!(run("screw?run_n_mm=1e6&seed=4").0[0] != bytes[0]);
}
