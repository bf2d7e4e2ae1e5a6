//! Physics of one finger for one frame of 30 Hz: four steps of 1/120 s, in the middle of a load ramp.
//! `cargo bench -p slipbound-lab --bench physics`; results with machine and settings in bench/lab-physics.md.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use slipbound::plane::Vec2;
use slipbound_lab::contact::shape::{Cylinder, FlatBox, Shape, Sphere};
use slipbound_lab::contact::{Body, Drive, Finger, FingerSettings, Grid, Inertia, Leg, Path, Wrench};
use std::hint::black_box;

const STEPS_A_FRAME: usize = 4;

/// 20 N, friction 0.8: pressed in 0.25 s, then loaded to half of full slip; the frame after that is timed.
fn frame(
    criterion: &mut Criterion,
    name: &str,
    settings: FingerSettings,
    shape: impl Shape + Clone + 'static,
    load: Leg,
) {
    let path = Path::new(vec![Leg::press(20.0, 0.25), load]).expect("a sound path");
    let mut finger = Finger::new(settings, shape).expect("sound settings");
    let commands: Vec<_> = path.commands(settings.substep_s).collect();
    let middle = 30 + (commands.len() - 30) / 2;
    for command in &commands[..middle] {
        finger.step(command).expect("a sound command");
    }
    let mut ahead = finger.clone();
    let iterations: Vec<_> = commands[middle..middle + STEPS_A_FRAME]
        .iter()
        .map(|command| {
            let truth = ahead.step(command).expect("a sound command");
            (truth.tangential_iterations_count, truth.normal_iterations_count)
        })
        .collect();
    println!("{name}: iterations of each step, tangential and normal: {iterations:?}");
    criterion.bench_function(name, |bencher| {
        bencher.iter_batched_ref(
            || finger.clone(),
            |finger| {
                for command in &commands[middle..middle + STEPS_A_FRAME] {
                    black_box(finger.step(command).expect("a sound command"));
                }
            },
            BatchSize::LargeInput,
        );
    });
}

fn physics(criterion: &mut Criterion) {
    let cap = Cylinder { radius_mm: 14.0, length_mm: 12.0, edge_radius_mm: 1.0 };
    let sphere = Sphere { radius_mm: 15.0 };
    let flat = FlatBox { length_mm: 20.0, width_mm: 15.0, edge_radius_mm: 1.0 };
    let wide = FlatBox { length_mm: 36.0, width_mm: 26.0, edge_radius_mm: 1.0 };
    let inertia = Inertia { mass_kg: 0.1, gyration_radius_mm: 20.0, centre_of_mass_mm: Vec2::ZERO };
    for (size, grid) in [("96x72", Grid::standard()), ("64x48", Grid::fast())] {
        let guided = FingerSettings { grid, ..FingerSettings::standard() };
        let free = FingerSettings { body: Body { drive: Drive::Free(inertia), fingers_count: 1 }, ..guided };
        let pull = Leg::pull(Wrench { force_n: Vec2::new(16.0, 0.0), torque_n_mm: 0.0 }, 1.0);
        frame(criterion, &format!("frame/{size}/cap, guided shear"), guided, cap, Leg::shear(3.0, 0.0, 1.0));
        frame(criterion, &format!("frame/{size}/sphere, guided shear"), guided, sphere, Leg::shear(2.0, 0.0, 1.0));
        frame(criterion, &format!("frame/{size}/flat 20x15, guided shear"), guided, flat, Leg::shear(1.2, 0.0, 1.0));
        frame(criterion, &format!("frame/{size}/flat 20x15, guided twist"), guided, flat, Leg::twist(0.2, 1.0));
        frame(criterion, &format!("frame/{size}/flat 36x26, guided shear"), guided, wide, Leg::shear(0.6, 0.0, 1.0));
        frame(criterion, &format!("frame/{size}/cap, free, force ramp"), free, cap, pull);
        frame(criterion, &format!("frame/{size}/flat 20x15, free, force ramp"), free, flat, pull);
        frame(criterion, &format!("frame/{size}/flat 36x26, free, force ramp"), free, wide, pull);
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(40).measurement_time(std::time::Duration::from_secs(3));
    targets = physics
}
criterion_main!(benches);
