//! Time of a 30 Hz frame of the simulated hand: four steps of jaws, wrist and contact, and the images.
//! `cargo bench -p slipbound-lab --bench hand`; results with machine and settings in bench/lab-physics.md.

use criterion::{Criterion, criterion_group, criterion_main};
use slipbound::port::{FrameBuffer, FrameSource, GripCommand, Gripper, Next, Wrist, WristCommand, WristMotion};
use slipbound_lab::hand::{HandScene, SimHand};

/// A grip of 20 N for a second, then the motion continues while it is timed.
fn frame(criterion: &mut Criterion, name: &str, scene: &str, motion: WristMotion, cameras_count: usize) {
    let hand = SimHand::new(&HandScene::parse(scene).expect("a sound scene")).expect("a sound hand");
    hand.gripper().command(GripCommand::Hold { force_n: 20.0 }).expect("taken over");
    for _ in 0..30 {
        hand.advance_frame();
    }
    let mut wrist = hand.wrist();
    let mut cameras: Vec<_> = (0..cameras_count).map(|finger| hand.camera(finger)).collect();
    let mut frame = FrameBuffer::default();
    criterion.bench_function(name, |bencher| {
        bencher.iter(|| {
            wrist.command(WristCommand::new(motion)).expect("taken over");
            hand.advance_frame();
            for camera in &mut cameras {
                assert_eq!(camera.next(&mut frame).expect("a frame"), Next::Frame);
            }
        });
    });
    assert_eq!(hand.error(), None);
}

fn hands(criterion: &mut Criterion) {
    let turn = WristMotion::Turn { rate_rad_per_s: 0.349, most_rad: 1.0 };
    let still = WristMotion::Pause;
    let runs = "screw?seal_deg=1440&stop_deg=1440&thread_mm_per_turn=0&longest_s=3600";
    let stands = "screw?run_n_mm=1000000&longest_s=3600";
    frame(criterion, "hand/cap that runs, no picture", runs, turn, 0);
    frame(criterion, "hand/cap that slides in the fingers, no picture", stands, turn, 0);
    frame(criterion, "hand/tool in the air, no picture", "place?longest_s=3600", still, 0);
    frame(criterion, "hand/bottle on its table, no picture", "lift?longest_s=3600", still, 0);
    frame(criterion, "hand/cap that runs, two pictures", runs, turn, 2);
    frame(criterion, "hand/cap that runs, one picture", &format!("{runs}&fingers=1"), turn, 1);
    frame(criterion, "hand/cap that runs, 96x72, no picture", &format!("{runs}&grid=standard"), turn, 0);
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).measurement_time(std::time::Duration::from_secs(3));
    targets = hands
}
criterion_main!(benches);
