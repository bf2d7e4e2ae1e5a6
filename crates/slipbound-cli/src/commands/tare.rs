//! `slipbound tare`: finds the rest frame of a finger once and saves it in a file for every later `--rest FILE`.

use super::marker_noise::MarkerNoise;
use super::rest_window::{Window, advice_where_touched};
use super::watch::StallDetector;
use super::{finger, inputs, recording};
use crate::outcome::{Failure, Outcome};
use crate::terminal::{Terminal, quoted};
use anyhow::anyhow;
use slipbound::finger_pipeline::FoundRest;
use slipbound::monitor::{RestBuilder, Settings, SlipMonitor};
use slipbound::sensor::Sensor;
use slipbound_rig::link::now_ns;
use slipbound_rig::printable::without_passwords;
use slipbound_rig::report_summary::frame_name;
use slipbound_rig::rest_file::{MadeOf, SavedRest};
use slipbound_rig::{config, file_origin, sensors, source};
use std::fs;
use std::path::{Path, PathBuf};

/// The arguments of `slipbound tare`.
#[derive(Debug, clap::Args)]
pub struct Tare {
    /// A camera (docs/cameras.md), a recording or a scene, of a finger that nothing touches in its first frames
    source: String,
    /// The finger: a built-in name (see `slipbound sensors`) or a sensor file [default: that of the
    /// scene, SOURCE/sensor.toml, or that in SOURCE.mcap, else by the size of the frames]
    #[arg(long, value_name = "NAME|FILE.toml")]
    sensor: Option<String>,
    /// How many of the first frames are searched for stationary ones, which are averaged [default: that of the
    /// settings, 20]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: Option<u32>,
    /// Settings that replace the defaults, the same as for `slipbound watch`; `paper` stands for the paper as written
    #[arg(long, value_name = "FILE.toml|paper")]
    settings: Option<String>,
    /// The file that is written, for `--rest` of other commands
    #[arg(short, long, value_name = "FILE", default_value = "finger.rest")]
    output: PathBuf,
    /// Overwrite a file that this program did not write
    #[arg(long)]
    force: bool,
}

impl Tare {
    /// Finds the rest frame and saves it; fails when something touches the finger, or nothing could be judged against
    /// it.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let mut settings = match &self.settings {
            Some(file) => config::load_settings(file).map_err(Failure::arguments)?,
            None => Settings::default(),
        };
        settings.rest.window_count = self.frames.unwrap_or(settings.rest.window_count);
        settings.rest.held = false; // a property of a recording, not of the finger
        let asked = self.sensor.as_deref().map(sensors::load).transpose().map_err(Failure::arguments)?;
        self.refuse_overwriting()?;
        let mut terminal = Terminal::plain();
        let mut recording = recording::open(&self.source)?;
        let mut stalls = StallDetector::new(StallDetector::LONGEST_MS);
        let silence = |is_silent| stalls.note(&self.source, now_ns(), is_silent, &terminal);
        let window = Window::read(&self.source, &mut recording, settings.rest.window_count, silence)?;
        let (sensor, note) = finger::of(&self.source, window.size, asked.as_ref(), None)?;
        note.iter().for_each(|note| terminal.note(note));
        let is_lossy = window.note_lost(&terminal);
        let FoundRest { rest, seqs, .. } = window.rest(&sensor, &settings, Some(&"tare"))?;
        let mut monitor = SlipMonitor::new(&sensor, &settings, rest.clone()).map_err(|e| window.refused(&sensor, e))?;
        if let Some(reason) = monitor.refusal() {
            return Err(anyhow!("{}: no frame could be judged against it: {reason}", self.source).into());
        }
        let marker_noise = MarkerNoise::measure(window.frames.iter().copied(), &mut monitor, |seq| seqs.contains(&seq));
        if let Some(seq) = marker_noise.touched_seq {
            return Err(self.touched(&window, seq, &sensor).into());
        }
        let noise = marker_noise.noise();
        let tells_touch = RestBuilder::new(&sensor, &settings, window.size).is_ok_and(|builder| builder.tells_touch());

        let (looked_at, averaged) = (window.frames.len(), rest.frames_count());
        let frames = format!("frames {} to {} averaged", seqs.start, seqs.end.saturating_sub(1));
        let frames = if averaged == 1 { format!("frame {}", seqs.start) } else { frames };
        let markers_count = rest.markers_count();
        let made_of = MadeOf {
            source: without_passwords(&self.source).into_owned(),
            frames: [seqs.start, seqs.end],
            noise_px: noise.as_ref().map(|(median_px, _)| *median_px),
            sensor,
            settings,
        };
        SavedRest { rest, made_of }.write(&self.output).map_err(|e| Failure::Work(e.into()))?;
        let source = &self.source;
        let touch = match tells_touch {
            true => "nothing touches it",
            false => "whether something touches it is unknown, its markers leave too little gel between them",
        };
        terminal.say(&format!("{source}: {touch}; {markers_count} markers, {frames} of {looked_at} looked at"))?;
        terminal.say(&match noise {
            Some((_, words)) => format!("noise {words}"),
            None => "noise unknown: it takes three frames, 20 are better".into(),
        })?;
        terminal.say(&format!("written: {}", self.output.display()))?;
        let (source, rest) = (quoted(source), self.output.display().to_string());
        // The rest frame is that of one finger and of one set of settings.
        let option = |name: &str, value: &Option<String>| {
            value.as_deref().map_or_else(String::new, |value| format!(" --{name} {}", quoted(value)))
        };
        let more = option("sensor", &self.sensor) + &option("settings", &self.settings);
        terminal.say(&format!("next: slipbound watch {source} --rest {}{more}", quoted(&rest)))?;
        Ok(if is_lossy { Outcome::DataLost } else { Outcome::Done })
    }

    /// Something touches the finger later in the window, from frame `seq` on.
    fn touched(&self, window: &Window<'_>, seq: u64, sensor: &Sensor) -> anyhow::Error {
        let count = window.frames.len();
        let frame = window.frames.iter().find(|frame| frame.seq == seq);
        let name = frame.map_or_else(|| format!("frame {seq}"), |frame| frame_name(frame));
        let expected = format!("expected a finger that nothing touches in its first {count} frames");
        let advice = advice_where_touched(sensor.skin);
        anyhow!("tare: {}: {expected}, got a touch in {name}: {advice}, or take fewer frames: --frames N", self.source)
    }

    /// The file may overwrite neither what is read nor a file of another program.
    fn refuse_overwriting(&self) -> Result<(), Failure> {
        let shown = self.output.display();
        inputs::refuse_stdout("--output", &self.output, "the name of a file")?;
        let Ok(place) = fs::canonicalize(&self.output) else { return Ok(()) };
        let mcap = source::mcap_file(&self.source).map(|(file, _)| file);
        let is = |other: &Path| fs::canonicalize(other).is_ok_and(|other| other == place);
        let inputs = [Some(mcap.unwrap_or(&self.source)), self.sensor.as_deref(), self.settings.as_deref()];
        let sensor_beside = self.sensor.is_none().then(|| sensors::beside(&self.source)).flatten();
        if inputs.into_iter().flatten().any(|input| is(Path::new(input)))
            || sensor_beside.is_some_and(|file| is(&file))
            || source::image_files(&self.source).iter().any(|file| is(file))
        {
            return Err(Failure::Arguments(anyhow!(
                "--output {shown}: expected a place of its own, got one that is read"
            )));
        }
        let is_foreign = place.is_dir() || (place.is_file() && !file_origin::is_own_file(&place).unwrap_or(false));
        match is_foreign && !(self.force && place.is_file()) {
            false => Ok(()),
            true => {
                let expected = "expected a new file, or one that slipbound wrote";
                Err(Failure::Arguments(anyhow!("--output: {expected}, got {shown} (--force overwrites a file)")))
            }
        }
    }
}
