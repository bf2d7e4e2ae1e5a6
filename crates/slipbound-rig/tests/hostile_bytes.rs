//! Images, rest files and settings files with changed bytes: a result or an error, never a panic. `SLIPBOUND_NOISE_CASES`
//! sets the number of cases. Images with missing bytes: `source/jpeg.rs`.

use slipbound::image::SizePx;
use slipbound::monitor::{RestBuilder, RestKind, Settings, SlipMonitor};
use slipbound::port::{FrameBuffer, PixelFormat};
use slipbound_rig::rest_file::{MadeOf, SavedRest};
use slipbound_rig::source::decode_image;
use slipbound_rig::{config, sensors};

/// Random numbers of a seed: xorshift64*.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % end.max(1)
    }
}

fn cases_count() -> usize {
    std::env::var("SLIPBOUND_NOISE_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(30_000)
}

/// Some bytes changed, the end cut off, a piece duplicated or left out.
fn spoil(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(6) {
        let at = random.below(bytes.len());
        match random.below(8) {
            0 => bytes.truncate(at),
            1 => {
                let end = (at + random.below(40)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            2 => {
                let end = (at + random.below(40)).min(bytes.len());
                bytes.drain(at..end);
            }
            3 => bytes.iter_mut().skip(at).take(4).for_each(|byte| *byte = 0xFF),
            // Headers are short and near the start.
            4 | 5 if !bytes.is_empty() => {
                let near = random.below(bytes.len().min(200));
                bytes[near] = random.below(256) as u8;
            }
            _ if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            _ => {}
        }
    }
}

fn pictures() -> Vec<Vec<u8>> {
    let (width, height) = (48u16, 33u16);
    let rgb: Vec<u8> = (0..3 * u32::from(width) * u32::from(height)).map(|i| (i * 7 % 251) as u8).collect();
    let mut all = Vec::new();
    for (colour, pixels) in [(jpeg_encoder::ColorType::Rgb, &rgb[..]), (jpeg_encoder::ColorType::Luma, &rgb[..1584])] {
        for progressive in [false, true] {
            let mut bytes = Vec::new();
            let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 80);
            encoder.set_progressive(progressive);
            encoder.encode(pixels, width, height, colour).expect("a picture can be encoded");
            all.push(bytes);
        }
    }
    for (colour, pixels) in [(png::ColorType::Rgb, &rgb[..]), (png::ColorType::Grayscale, &rgb[..1584])] {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, u32::from(width), u32::from(height));
        encoder.set_color(colour);
        let mut writer = encoder.write_header().expect("memory");
        writer.write_image_data(pixels).expect("memory");
        writer.finish().expect("memory");
        all.push(bytes);
    }
    all
}

#[test]
fn a_picture_with_changed_bytes_is_whole_or_an_error() {
    let (good, mut random) = (pictures(), Random(0x5EED));
    let mut frame = FrameBuffer::default();
    let (mut whole_count, mut refused_count) = (0, 0);
    for case in 0..cases_count() {
        frame.encoded.clone_from(&good[case % good.len()]);
        if case >= good.len() {
            spoil(&mut frame.encoded, &mut random);
        }
        match decode_image(&mut frame) {
            Ok(()) => {
                let bytes_a_pixel = if frame.format == PixelFormat::Gray { 1 } else { 3 };
                assert_eq!(frame.pixels.len(), bytes_a_pixel * frame.size.area(), "case {case}");
                whole_count += 1;
            }
            Err(reason) => {
                assert!(!reason.is_empty(), "case {case}");
                refused_count += 1;
            }
        }
    }
    assert!(whole_count >= good.len() && refused_count > 0, "{whole_count} whole, {refused_count} refused");
}

#[test]
fn settings_with_changed_bytes_are_read_or_refused() {
    let sensor = include_str!("../../../sensors/gelslim.toml");
    let settings = config::settings_to_toml(&slipbound::monitor::Settings::default()).expect("TOML");
    let mut random = Random(0xC0FFEE);
    let (mut read_count, mut refused_count) = (0, 0);
    for case in 0..cases_count() / 10 {
        let mut bytes = if case % 2 == 0 { sensor.as_bytes().to_vec() } else { settings.clone().into_bytes() };
        if case > 1 {
            spoil(&mut bytes, &mut random);
        }
        let Ok(text) = String::from_utf8(bytes) else { continue };
        let error = match case % 2 {
            0 => config::sensors::parse(&text, "changed.toml").err().map(|e| e.to_string()),
            _ => config::parse_settings(&text, "changed.toml").err().map(|e| e.to_string()),
        };
        match error {
            None => read_count += 1,
            Some(error) => {
                assert!(error.contains("changed.toml"), "case {case}: {error}");
                refused_count += 1;
            }
        }
    }
    assert!(read_count >= 2 && refused_count > 100, "{read_count} read, {refused_count} refused");
}

/// The rest file of a finger with 6 x 5 dots.
fn rest_file(size: SizePx) -> Vec<u8> {
    let mut sensor = sensors::load("gelsight_mini_wide").expect("built in");
    (sensor.image_px, sensor.pitch_px, sensor.marker_diameter_px) = (size, 14.0, 6.0);
    let off = |v: usize| (v as f64 - 13.0) - 14.0 * ((v as f64 - 13.0) / 14.0).round();
    let level = |i: usize| {
        let (x, y) = (off(i % size.width), off(i / size.width));
        (140.0 - 110.0 * (3.5 - (x * x + y * y).sqrt()).clamp(0.0, 1.0)) as u8
    };
    let pixels = (0..size.area()).map(level).collect();
    let frame = FrameBuffer { pixels, size, format: PixelFormat::Gray, ..FrameBuffer::default() };
    let mut builder = RestBuilder::new(&sensor, &Settings::default(), size).expect("valid");
    builder.add(&frame.frame().expect("whole")).expect("bright");
    let rest = builder.build(RestKind::Unloaded).expect("markers");
    let made_of =
        MadeOf { source: "here".into(), frames: [0, 1], noise_px: None, sensor, settings: Settings::default() };
    SavedRest { rest, made_of }.to_bytes().expect("numbers")
}

/// The checksum would refuse nearly every case, so it is computed again.
#[test]
fn a_finger_at_rest_with_changed_bytes_is_one_or_is_refused() {
    let size = SizePx::new(96, 72);
    let good = rest_file(size);
    let behind = good.iter().position(|byte| *byte == b'\n').expect("lines") + 1;
    let mut random = Random(0x7A6E);
    let (mut judged_count, mut refused_count) = (0, 0);
    for case in 0..cases_count() / 30 {
        let mut bytes = good[behind..].to_vec();
        if case > 0 {
            spoil(&mut bytes, &mut random);
        }
        let crc32 = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes);
        let length = bytes.len();
        let first = format!(
            "{{\"format\":\"slipbound-rest\",\"format_version\":1,\"software_version\":\"\",\"bytes\":{length},\"crc32\":{crc32}}}\n"
        );
        let saved = match SavedRest::from_bytes(&[first.as_bytes(), &bytes].concat(), "changed.rest") {
            Ok(saved) => saved,
            Err(error) => {
                assert!(error.to_string().contains("changed.rest"), "case {case}: {error}");
                refused_count += 1;
                continue;
            }
        };
        let sensor = saved.made_of.sensor.clone();
        let Ok(mut monitor) = SlipMonitor::new(&sensor, &saved.made_of.settings, saved.rest) else {
            refused_count += 1;
            continue;
        };
        let frame =
            FrameBuffer { pixels: vec![120; size.area()], size, format: PixelFormat::Gray, ..FrameBuffer::default() };
        monitor.step(&frame.frame().expect("whole"), None);
        judged_count += 1;
    }
    assert!(judged_count > 10 && refused_count > 100, "{judged_count} judged, {refused_count} refused");
}
