//! The overlay of a computed finger: every symbol appears in its colour, and nowhere else.

use slipbound::events::SlipEvent;
use slipbound::image::{Frame, Gray, Pixels, SizePx};
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor, SlipReport, SlipRule, SlipState};
use slipbound::plane::Vec2;
use slipbound::port::{FrameBuffer, FrameSource, Next, PixelFormat};
use slipbound_rig::avi_writer::MAX_BYTES;
use slipbound_rig::overlay::{Drawn, Overlay, OverlayInput, OverlayOptions, OverlayWriter};
use slipbound_rig::report_summary::ReportSummary;
use slipbound_rig::run::RecordingPage;
use slipbound_rig::sensors;
use slipbound_rig::source;
use std::fs;

const SIZE: SizePx = SizePx::new(320, 240);

/// Dots of 11 px on a grid of 30.8 px. With contact, a patch in the middle is shaded and its dots move by `moved`.
fn imprint(contact: bool, moved: impl Fn(Vec2) -> Vec2) -> Vec<u8> {
    let middle = Vec2::new(160.0, 120.0);
    let touched = |p: Vec2| contact && (p - middle).length() < 80.0;
    let mut dots = Vec::new();
    for row in 0..7 {
        for column in 0..10 {
            let at = Vec2::new(20.0 + 30.8 * f64::from(column), 27.0 + 30.8 * f64::from(row));
            dots.push(if touched(at) { at + moved(at - middle) } else { at });
        }
    }
    let mut pixels = Vec::with_capacity(SIZE.area());
    for y in 0..SIZE.height {
        for x in 0..SIZE.width {
            let p = Vec2::new(x as f64, y as f64);
            let shade = if touched(p) { 45.0 * libm::sin(p.x / 5.0) } else { 0.0 };
            let nearest = dots.iter().map(|d| (p - *d).length()).fold(f64::INFINITY, f64::min);
            let cover = (6.0 - nearest).clamp(0.0, 1.0);
            pixels.push(((140.0 + shade) * (1.0 - cover) + 30.0 * cover) as u8);
        }
    }
    pixels
}

fn frame(pixels: &[u8], seq: u64) -> Frame<'_> {
    Frame { pixels: Pixels::Gray(Gray::new(pixels, SIZE).expect("whole")), seq, time_ns: None }
}

/// A monitor that has just seen the patch turn by 0.12 rad while its rim, outside the inner 55 px, stays behind. Slip
/// by the paper's rule, which decides for single markers.
fn slipping() -> (SlipMonitor, Vec<u8>, SlipReport) {
    let sensor = sensors::load("gelsight_mini_wide").expect("built in");
    let mut settings = Settings::default();
    settings.slip.rule = SlipRule::Markers;
    let mut builder = RestBuilder::new(&sensor, &settings, SIZE).expect("valid");
    let rest = imprint(false, |_| Vec2::ZERO);
    builder.add(&frame(&rest, 0)).expect("bright");
    let mut monitor =
        SlipMonitor::new(&sensor, &settings, builder.build(RestKind::Unloaded).expect("dots")).expect("ok");
    let mut last = None;
    for seq in 1..=20 {
        let share = seq as f64 / 20.0;
        let pixels = imprint(true, |arm| {
            let inner = if arm.length() < 55.0 { 1.0 } else { 0.0 };
            (arm.turned() * 0.16 + Vec2::new(6.0, 0.0)) * (share * inner)
        });
        let report = monitor.step(&frame(&pixels, seq), None);
        let slips = report.state == SlipState::Incipient;
        last = Some((pixels, report));
        if slips {
            break;
        }
    }
    let (pixels, report) = last.expect("twenty frames");
    (monitor, pixels, report)
}

/// Pixels of exactly this colour in the left and in the right half.
fn count(overlay: &Overlay, rgb: [u8; 3]) -> [usize; 2] {
    let width = overlay.size().width;
    let mut counts = [0, 0];
    let picture = overlay.rgb();
    let panels = &picture[3 * width * 76..picture.len() - 3 * width * 40];
    for (i, pixel) in panels.chunks_exact(3).enumerate() {
        counts[usize::from(i % width > width / 2)] += usize::from(pixel == rgb);
    }
    counts
}

const YELLOW: [u8; 3] = [255, 222, 0];
const BLUE: [u8; 3] = [86, 180, 233];
const BLACK: [u8; 3] = [0, 0, 0];
const PURPLE: [u8; 3] = [150, 30, 200];

#[test]
fn every_sign_is_drawn_in_its_panel() {
    let (monitor, pixels, report) = slipping();
    assert_eq!(report.state, SlipState::Incipient, "{report:?}");
    assert_eq!(OverlayInput::from(&monitor).alarm_margin, None, "markers decide: no margin in the headline");
    let mut overlay = Overlay::new(monitor.sensor());
    assert_eq!(overlay.size(), SizePx::new(2 * 960 + 8, 76 + 720 + 40));
    overlay.draw(Some(&frame(&pixels, report.seq)), &report, &monitor);
    for (colour, what, [left, right]) in [
        (YELLOW, "measured displacement", [true, false]),
        (BLUE, "rigid displacement", [true, false]),
        (PURPLE, "slipping markers", [false, true]),
    ] {
        let seen = count(&overlay, colour);
        assert_eq!(seen.map(|n| n > 100), [left, right], "{what}: {seen:?} pixels");
    }
    assert!(count(&overlay, BLACK)[1] > 300, "slip field: {:?}", count(&overlay, BLACK));
    let slipping = monitor.markers().iter().filter(|m| m.over).count();
    let purple = count(&overlay, PURPLE)[1];
    assert!(purple < slipping * 700 && purple > slipping * 60, "{purple} purple pixels for {slipping} markers");

    let again = overlay.rgb();
    overlay.draw(Some(&frame(&pixels, report.seq)), &report, &monitor);
    assert_eq!(overlay.rgb(), again, "nothing of the picture before shows through");

    // Made of the sensor file, which states another size than the frames have: the size of the frames counts.
    let stated = monitor.sensor().at_size(SizePx::new(2 * SIZE.width, 2 * SIZE.height)).expect("twice the size");
    let mut overlay = Overlay::new(&stated);
    overlay.draw(Some(&frame(&pixels, report.seq)), &report, &monitor);
    assert_eq!(overlay.rgb(), again);
}

#[test]
fn what_is_not_judged_has_no_arrows() {
    let (monitor, pixels, report) = slipping();
    let mut overlay = Overlay::new(monitor.sensor());
    overlay.draw(Some(&frame(&pixels, report.seq)), &report, &monitor);
    let torn = monitor.torn(report.seq + 1, None);
    overlay.draw(None, &torn, &monitor);
    for colour in [YELLOW, BLUE, PURPLE, BLACK] {
        assert_eq!(count(&overlay, colour), [0, 0], "{colour:?}");
    }
    let small = [9; 32 * 32];
    let other =
        Frame { pixels: Pixels::Gray(Gray::new(&small, SizePx::new(32, 32)).expect("whole")), seq: 0, time_ns: None };
    overlay.draw(Some(&other), &torn, &monitor);
    assert_eq!(count(&overlay, YELLOW), [0, 0]);
}

const RECORDING: OverlayOptions = OverlayOptions { rate_hz: 25, most_bytes: MAX_BYTES, waits: true };

fn buffer(pixels: &[u8]) -> FrameBuffer {
    FrameBuffer { pixels: pixels.to_vec(), format: PixelFormat::Gray, size: SIZE, ..FrameBuffer::default() }
}

#[test]
fn pictures_go_in_order_into_a_folder_or_a_video() {
    let (monitor, pixels, report) = slipping();
    let frame = buffer(&pixels);
    let dir = tempfile::tempdir().expect("a folder");
    let (folder, video) = (dir.path().join("new/folder"), dir.path().join("video.AVI"));
    // Every second frame did not arrive whole: pictures that take less time must not overtake the others.
    let reports: Vec<_> = (7..17).map(|seq| SlipReport { seq, ..report }).collect();
    let whole = |report: &SlipReport| (report.seq % 2 == 1).then_some(&frame);
    for (to, exact) in [(&folder, true), (&video, false)] {
        let mut writer = OverlayWriter::create(to, monitor.sensor(), RECORDING).expect("creates");
        reports.iter().for_each(|report| assert!(writer.push(whole(report), report, &monitor)));
        assert_eq!(writer.finish().expect("finishes"), Drawn { lost_count: 0, full_at_seq: None });
        let mut source = source::open(to.to_str().expect("UTF-8")).expect("opens");
        let (mut read, mut overlay) = (FrameBuffer::default(), Overlay::new(monitor.sensor()));
        for report in &reports {
            overlay.draw(whole(report).map(|f| f.frame().expect("whole")).as_ref(), report, &monitor);
            assert_eq!(source.next(&mut read).expect("reads"), Next::Frame);
            assert_eq!(read.size, overlay.size());
            let differences = read.pixels.iter().zip(&overlay.rgb()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
            let most: u64 = if exact { 0 } else { 2 * read.pixels.len() as u64 };
            assert!((0..=most).contains(&differences), "frame {}: {differences}", report.seq);
        }
        assert_eq!(source.next(&mut read).expect("reads"), Next::End);
    }
    assert!(folder.join("000007.png").exists() && folder.join("000016.png").exists());
}

/// A camera does not wait for pictures.
#[test]
fn a_camera_s_frames_that_cannot_be_drawn_in_time_are_left_out_and_counted() {
    let (monitor, pixels, report) = slipping();
    let (frame, dir) = (buffer(&pixels), tempfile::tempdir().expect("a folder"));
    let options = OverlayOptions { waits: false, ..RECORDING };
    let mut writer = OverlayWriter::create(dir.path(), monitor.sensor(), options).expect("creates");
    let pushed_count = 300;
    for seq in 0..pushed_count {
        assert!(writer.push(Some(&frame), &SlipReport { seq, ..report }, &monitor));
    }
    let lost_count = writer.finish().expect("finishes").lost_count;
    let written_count = fs::read_dir(dir.path()).expect("there").count() as u64;
    assert!(lost_count > 0 && written_count > 0, "{lost_count} lost, {written_count} written");
    assert_eq!(lost_count + written_count, pushed_count);
}

#[test]
fn what_cannot_be_written_ends_the_overlay_with_its_reason() {
    let (monitor, pixels, report) = slipping();
    let (frame, dir) = (buffer(&pixels), tempfile::tempdir().expect("a folder"));
    let (folder, video) = (dir.path().join("pictures"), dir.path().join("video.avi"));
    let push_all = |to, options| {
        let mut writer = OverlayWriter::create(to, monitor.sensor(), options).expect("creates");
        fs::remove_dir_all(&folder).unwrap_or(());
        let pushed = (0..100).take_while(|&seq| writer.push(Some(&frame), &SlipReport { seq, ..report }, &monitor));
        assert!(pushed.count() < 100, "it is told that nothing more is written");
        writer.finish()
    };
    let error = push_all(&folder, RECORDING).expect_err("the folder is gone").to_string();
    assert!(error.contains("pictures/000000.png: cannot write"), "{error}");
    let drawn = push_all(&video, OverlayOptions { most_bytes: 1_000_000, ..RECORDING }).expect("a full video is whole");
    let full_at_seq = drawn.full_at_seq.expect("full");
    let mut source = source::open(video.to_str().expect("UTF-8")).expect("opens");
    let mut read = FrameBuffer::default();
    let read_count = (0..).take_while(|_| source.next(&mut read).expect("reads") == Next::Frame).count();
    assert_eq!(read_count as u64, full_at_seq, "ends before the frame that is named");
}

#[test]
fn a_torn_frame_without_a_time_does_not_take_the_times_of_the_others_from_the_page() {
    let (monitor, _, report) = slipping();
    let label = |times_ns: &[Option<u64>]| {
        let mut page = RecordingPage::new("a clip", "left", None, &monitor);
        for (seq, &time_ns) in (0..).zip(times_ns) {
            page.see(&if seq == 1 { monitor.torn(seq, time_ns) } else { SlipReport { seq, time_ns, ..report } });
        }
        let html = page.html(&ReportSummary::new());
        (html.contains("time, s<"), html.contains("number of the frame<"), html.contains("0.06 s</b> from the first"))
    };
    let ms = |ms: u64| Some(ms * 1_000_000);
    assert_eq!(label(&[ms(1000), None, ms(1060)]), (true, false, true));
    assert_eq!(label(&[None, None, None]), (false, true, false));
    assert_eq!(label(&[ms(1000), None, None]), (false, true, false), "a whole frame without one");
}

#[test]
fn the_page_of_a_recording_tells_once_from_which_slip_on_there_is_no_picture() {
    let (monitor, pixels, report) = slipping();
    let frame = buffer(&pixels);
    let mut page = RecordingPage::new("a clip", "left", None, &monitor);
    page.see(&report);
    let told = "Pictures of the first 60 slips only";
    for slip in 1..=62 {
        let begins = SlipEvent::Begins { slip, seq: report.seq, time_ns: None, kind: None, direction_rad: None };
        page.event(&begins, "slip", &frame, &monitor);
        if [60, 62].contains(&slip) {
            let html = page.html(&ReportSummary::new());
            let [r, g, b] = PURPLE;
            assert!(html.contains(&format!("--incipient: #{r:02x}{g:02x}{b:02x}")), "as on the overlay");
            let shown = (html.matches("<img").count(), html.matches(told).count());
            assert_eq!(shown, (60, usize::from(slip > 60)), "{slip} slips");
            assert!(slip == 60 || html.find(told) < html.find("id=\"slip-61\""));
        }
    }
}
