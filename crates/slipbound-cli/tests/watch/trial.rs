//! A folder with a recording made for the test, and the command run on it.

use crate::program::{Ended, command};
use serde_json::Value;
use slipbound::image::SizePx;
use slipbound_rig::avi_writer::AviWriter;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

pub const SIZE: SizePx = SizePx::new(320, 240);
pub const SENSOR: [&str; 2] = ["--sensor", "gelsight_mini_wide"];

/// Dots of 11 px on a grid of 30.8 px, a little further to the right from frame to frame.
pub fn jpeg(frame: usize) -> Vec<u8> {
    let pixels: Vec<u8> = (0..SIZE.area())
        .map(|i| {
            let (x, y) = ((i % SIZE.width) as f64 - 20.0 - 0.01 * frame as f64, (i / SIZE.width) as f64 - 27.0);
            let off = |v: f64| v - 30.8 * (v / 30.8).round();
            let distance = (off(x) * off(x) + off(y) * off(y)).sqrt();
            let cover = (6.0 - distance).clamp(0.0, 1.0);
            (140.0 - 110.0 * cover) as u8
        })
        .collect();
    encode(&pixels, SIZE)
}

pub fn encode(grey: &[u8], size: SizePx) -> Vec<u8> {
    let mut out = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut out, 90);
    encoder.encode(grey, size.width as u16, size.height as u16, jpeg_encoder::ColorType::Luma).expect("encodes");
    out
}

/// A folder with a recording of some frames in it.
pub struct Trial {
    pub dir: tempfile::TempDir,
}

impl Trial {
    pub fn new(frames_count: usize) -> Self {
        let trial = Trial { dir: tempfile::tempdir().expect("a folder") };
        fs::create_dir(trial.path("run")).expect("makes a folder");
        for i in 0..frames_count {
            trial.write(&format!("run/{i:03}.jpg"), &jpeg(i));
        }
        trial
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("writes");
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = command(arguments);
        command.current_dir(self.dir.path());
        command
    }

    /// Runs `slipbound watch SOURCE` with the finger and further arguments.
    pub fn watch(&self, source: &str, more: &[&str]) -> Ended {
        let arguments = [&["watch", source], &SENSOR[..], more].concat();
        Ended::of(self.command(&arguments).output().expect("runs"))
    }

    pub fn report(&self, name: &str) -> Vec<Value> {
        let text = fs::read_to_string(self.path(name)).expect("a report");
        assert!(text.ends_with('\n'), "the last line is whole");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }
}

pub fn states(report: &[Value]) -> Vec<&str> {
    report[1..].iter().map(|line| line["state"].as_str().expect("a state")).collect()
}

pub fn write_avi(path: &Path, frames_count: usize) {
    let mut avi = AviWriter::create(path, SIZE, 25).expect("creates");
    for i in 0..frames_count {
        avi.push(&jpeg(i)).expect("writes");
    }
    avi.finish().expect("finishes");
}
