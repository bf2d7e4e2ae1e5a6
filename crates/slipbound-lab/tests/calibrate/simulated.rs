//! The simulated finger of the paper with all its surroundings.

use crate::drawn::Truth;
use crate::{known, number, reprojection_pitch};
use slipbound::calibrate::{Calibration, CalibrationError, FRAMES_MOST, KnownFacts, calibrate};
use slipbound::finger_pipeline::rest_from;
use slipbound::image::{Frame, Pixels, Rgb, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings};
use slipbound::plane::{Homography, Vec2};
use slipbound::port::{FrameBuffer, FrameSource as _, Next};
use slipbound::sensor::{Flip, Skin};
use slipbound_lab::contact::{Displacement, FingerSettings};
use slipbound_lab::jpeg::Codec;
use slipbound_lab::render::{Renderer, Surface, Surroundings};
use slipbound_lab::scenes::Trial;
use slipbound_lab::world::World;

/// The simulated GelSlim at rest with all its surroundings: the camera frame after JPEG 85; its grid of dots without
/// jitter, about the middle of the nodes, and its position in the camera image.
fn render_frame(seed: u64) -> (Truth, Vec<Vec2>, FrameBuffer, SizePx) {
    let mut camera = Renderer::gelslim(seed).with_surroundings(Surroundings::Full);
    let (sensor, size) = (camera.sensor(), camera.size());
    let grid = FingerSettings::standard().grid;
    let displacement = vec![Displacement::default(); grid.cells_count()];
    let pressure_mpa = vec![0.0; grid.cells_count()];
    let untouched = Surface { grid: &grid, displacement: &displacement, pressure_mpa: &pressure_mpa };
    let (mut rgb, mut picture) = (vec![0; 3 * size.area()], FrameBuffer::default());
    camera.render(&untouched, seed, &mut rgb);
    let codec = Codec::new(size, 85);
    codec.encode(&rgb, &mut picture.encoded).expect("encodes");
    codec.decode(&mut picture).expect("decodes");
    let pitch_px = sensor.pitch_px;
    let seen: Vec<Vec2> =
        (0..camera.markers_at_rest_mm().len()).map(|i| camera.marker_rectified_px(i, &untouched)).collect();
    // A dot's jitter is a thirtieth of a pitch: the mean over all dots is the position of the grid.
    let number = |p: Vec2| Vec2::new(((p - seen[0]).x / pitch_px).round(), ((p - seen[0]).y / pitch_px).round());
    let nodes: Vec<Vec2> = seen.iter().map(|p| number(*p)).collect();
    let origin = seen.iter().zip(&nodes).fold(Vec2::ZERO, |sum, (p, n)| sum + (*p - *n * pitch_px)) / seen.len() as f64;
    let map = sensor.rectification.as_ref().expect("it is seen aslant");
    let [left, top, ..] = map.crop_px.map(|px| px as f64);
    let plane = Homography([[pitch_px, 0.0, origin.x + left], [0.0, pitch_px, origin.y + top], [0.0, 0.0, 1.0]]);
    let homography = map.homography.inverse().expect("a camera").after(&plane);
    (Truth { homography, bend: [0.0; 5], half_span: 1.0 }, nodes, picture, size)
}

/// Walls, highlights and dirt do not affect the map of the paper's finger.
#[test]
fn a_simulated_finger_is_calibrated_among_its_surroundings() {
    let (from, count) = (number("SLIPBOUND_CALIBRATE_FROM", 0), number("SLIPBOUND_CALIBRATE_COUNT", 6));
    let (mut right, mut refused, mut wrong, mut errors) = (0, 0, 0, Vec::new());
    for seed in from..from + count {
        let (truth, nodes, picture, size) = render_frame(seed);
        let frame =
            Frame { pixels: Pixels::Rgb(Rgb::new(&picture.pixels, size).expect("whole")), seq: 0, time_ns: None };
        let known = KnownFacts { flip: Flip::Vertical, skin: Skin::Fabric, ..known() };
        match calibrate(&[frame], &known) {
            Err(e) => {
                println!("seed {seed}: refused: {e}");
                refused += 1;
            }
            Ok(found) => {
                let (rms, worst) = reprojection_pitch(&found.sensor, &truth, &nodes, size);
                let (markers, off_grid) = (found.markers.len(), found.off_grid.len());
                println!(
                    "seed {seed}: {markers} markers, {off_grid} off the grid; reprojection {rms:.4}, worst {worst:.4}"
                );
                if rms <= 0.03 {
                    right += 1
                } else {
                    wrong += 1
                }
                errors.push(rms);
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    println!(
        "{count} simulated fingers: {right} right, {refused} refused, {wrong} wrong; reprojection median {:.4}, worst {:.4} pitch",
        errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN),
        errors.last().copied().unwrap_or(f64::NAN)
    );
    assert_eq!(wrong, 0);
    assert!(100 * refused <= count, "{refused} of {count} refused");
}

/// The drawn grid begins at its first markers: rows of the housing outside it, here given without the flip, are not
/// part of it.
#[test]
fn the_grid_begins_where_its_markers_do() {
    for (seed, flip) in [(0, Flip::None), (1, Flip::None), (2, Flip::Vertical), (3, Flip::None)] {
        let (_, nodes, picture, size) = render_frame(seed);
        let frame =
            Frame { pixels: Pixels::Rgb(Rgb::new(&picture.pixels, size).expect("whole")), seq: 0, time_ns: None };
        let found = calibrate(&[frame], &KnownFacts { flip, skin: Skin::Fabric, ..known() }).expect("calibrated");
        let first = [0, 1].map(|axis| found.markers.iter().map(|m| m.node[axis]).min().expect("markers"));
        let pitch_px = found.sensor.pitch_px;
        for m in &found.markers {
            let at = Vec2::new(f64::from(m.node[0] - first[0]), f64::from(m.node[1] - first[1])) * pitch_px;
            let drawn = found.sensor.camera_from_rectified(at + found.origin_px());
            let off_pitch = (drawn - m.camera_px).length() / pitch_px;
            assert!(off_pitch < 0.3, "seed {seed}, {flip:?}: node {:?} is drawn {off_pitch} pitch off", m.node);
        }
        // As many rows as there are, and a few mirrored ones.
        let rows_px = found.sensor.rectified_px().height as f64;
        let true_rows =
            nodes.iter().map(|n| n.y).fold(f64::MIN, f64::max) - nodes.iter().map(|n| n.y).fold(f64::MAX, f64::min);
        println!("seed {seed}, {flip:?}: {} rows of {}", rows_px / pitch_px - 1.5, true_rows);
    }
}

/// The same frame with every row blurred over 61 px.
fn blurred(frame: &FrameBuffer) -> FrameBuffer {
    let mean = |row: &[u8], i: usize| {
        let over = (-30..=30).filter_map(|by: isize| row.get(i.checked_add_signed(3 * by)?));
        let (sum, count) = over.fold((0, 0), |(sum, count), v| (sum + u32::from(*v), count + 1));
        (sum / count) as u8
    };
    let rows = frame.pixels.chunks(3 * frame.size.width);
    let pixels = rows.flat_map(|row| (0..row.len()).map(|i| mean(row, i)).collect::<Vec<_>>()).collect();
    FrameBuffer { pixels, ..frame.clone() }
}

/// Eight frames at rest, then a cap pressed with 30 N: pressed frames do not become the finger at rest because the
/// first frame shows no grid.
#[test]
fn a_blurred_first_frame_does_not_make_pressed_frames_the_finger_at_rest() {
    let scene = "shear?camera=gelsight_mini&grid=fast&seed=1&object=bottle_cap&force_n=30&rest_frames=8&press_s=0.1\
                 &settle_s=0.05&distance_mm=3&speed_mm_per_s=12";
    let mut world = World::new(&Trial::parse(scene).expect("a scene")).expect("a world");
    let mut buffers = vec![FrameBuffer::default(); FRAMES_MOST];
    buffers.iter_mut().for_each(|buffer| assert_eq!(world.next(buffer).expect("renders"), Next::Frame));
    let try_all = |buffers: &[FrameBuffer]| -> Result<Calibration, CalibrationError> {
        let frames: Vec<Frame<'_>> = buffers.iter().map(|buffer| buffer.frame().expect("whole")).collect();
        calibrate(&frames, &known())
    };
    let clear = try_all(&buffers).expect("calibrated");
    buffers[0] = blurred(&buffers[0]);
    try_all(&buffers[..1]).expect_err("no grid is seen");
    let found = try_all(&buffers).expect("calibrated");
    assert!(found.untouched && found.averaged[0] >= 1 && found.averaged[1] <= 7, "{:?}", found.averaged);
    let sharpness = |found: &Calibration| found.sensor.bare_sharpness.expect("untouched");
    let ratio = sharpness(&found) / sharpness(&clear);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    let builder = RestBuilder::new(&found.sensor, &Settings::default(), found.sensor.image_px).expect("valid");
    let pressed: Vec<Frame<'_>> = buffers[16..].iter().map(|buffer| buffer.frame().expect("whole")).collect();
    assert_eq!(rest_from(builder, &pressed).map(|rest| rest.kind()), Ok(RestKind::InContact));
}
