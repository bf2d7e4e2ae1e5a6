//! What a camera that is lost and back does, without one.

use super::*;
use std::cell::Cell;

#[test]
fn a_camera_that_comes_back_without_its_size_says_so_once_and_one_that_is_gone_nothing() {
    let options = Options::parse("v4l2:Mini?size=640x480").expect("valid");
    let first = NegotiatedSettings { kind: PixelKind::Yuyv, size: (640, 480), rate_hz: None, locked: [None; 4] };
    let node = CameraNode {
        path: "/dev/video0".into(),
        name: "Mini".into(),
        serial: Some("28H8".into()),
        usb_device: None,
        usb_id: None,
        formats: vec!["YUYV".into()],
    };
    let mut camera = V4l2::away(options, CameraId::of(&node, &[]), first);
    let mut next_after = |problem: Problem| {
        camera.stays_away(problem);
        camera.retry_at_ns = u64::MAX;
        camera.next(&mut FrameBuffer::default()).expect("goes on")
    };
    let other = || Problem::Asked("a size that the camera has in YUYV: 320x240; got 640x480".into());
    assert_eq!(next_after(Problem::Missing("a camera, got none".into())), Next::Silent);
    assert_eq!(next_after(Problem::Device(io::Error::other("busy"))), Next::Silent);
    let Next::Torn { reason } = next_after(other()) else { panic!("it says nothing") };
    assert!(reason.ends_with("expected a size that the camera has in YUYV: 320x240; got 640x480"), "{reason}");
    assert_eq!(next_after(other()), Next::Silent, "once");
    let stranger = || Problem::Other("the one with serial 28H8, got /dev/video0 Mini serial 41AA".into());
    let Next::Torn { reason } = next_after(stranger()) else { panic!("it says nothing") };
    let expected = "the camera is back, but it is another one: expected the one with serial 28H8, got ";
    assert!(reason.starts_with(expected), "{reason}");
    assert_eq!(next_after(stranger()), Next::Silent, "once");
    assert_eq!(camera.tally.counts().torn_count, 2);
}

#[test]
fn a_camera_that_gives_a_frame_in_five_seconds_is_not_silent_for_three() {
    let silent_ms = |rate_hz| silent_ns(rate_hz) / 1_000_000;
    assert_eq!([None, Some(30.0), Some(1.0), Some(0.2)].map(silent_ms), [3000, 3000, 3000, 15_000]);
    assert_eq!(silent_ns(Some(0.0)), u64::MAX, "a driver that says nonsense");
}

#[test]
fn frames_that_wait_are_skipped_and_as_many_more_as_asked_for_a_limited_time() {
    // Two frames wait; then one comes every `period_ms`.
    for (period_ms, more_count) in [(33, 3), (700, 2), (u64::MAX, 0)] {
        let now_ms = Cell::new(0u64);
        let (mut waiting_count, mut next_ms, mut skipped_count) = (2, period_ms, 0);
        let skip = |wait_ms: u16| {
            let until_ms = now_ms.get() + u64::from(wait_ms);
            let comes = waiting_count > 0 || next_ms <= until_ms;
            match waiting_count {
                0 if comes => {
                    now_ms.set(next_ms.max(now_ms.get()));
                    next_ms = next_ms.saturating_add(period_ms);
                }
                0 => now_ms.set(until_ms),
                _ => waiting_count -= 1,
            }
            skipped_count += u32::from(comes);
            Ok(comes)
        };
        settle(3, || now_ms.get() * 1_000_000, skip).expect("no error");
        assert_eq!(skipped_count, 2 + more_count, "a frame every {period_ms} ms");
        assert!(now_ms.get() <= SETTLE_NS / 1_000_000, "{} ms", now_ms.get());
    }
}
