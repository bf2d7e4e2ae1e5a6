//! Shear stiffness from a recording that begins untouched, then holds a mass that stands, and ends with the mass
//! hanging.

use crate::report_summary::{of_other_size, torn};
use crate::source::{ReadAhead, most_common_size};
use slipbound::calibrate::{
    HangingFrame, ShearError, outermost, shear_stiffness, stationary_end, stationary_held, steadied,
};
use slipbound::finger_pipeline::RestFinder;
use slipbound::image::ImageError;
use slipbound::monitor::{Reason, RestError, RestKind, Settings, SlipMonitor, SlipRule};
use slipbound::port::{FrameBuffer, FrameSource, Next, SourceError};
use slipbound::sensor::{Sensor, Shear};
use slipbound::setting::SettingError;
use std::ops::Range;

/// Plausible shear modulus over thickness of a gel, MPa/mm. Gels of tactile fingers have a modulus of 0.05 to 0.2 MPa
/// and are 1 to 6 mm thick, 0.008 to 0.2 MPa/mm; a factor of ten either way covers what the model leaves out.
const GEL_MPA_PER_MM: [f64; 2] = [0.0008, 2.0];

/// Range assumed for an unknown marker pitch, mm; that of the GelSlim is 1.5.
const PITCHES_MM: [f64; 2] = [1.0, 3.0];

/// What hangs on the finger, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct HangingMass {
    /// Mass, g.
    pub mass_g: f64,
    /// Fingers that share it.
    pub fingers_count: u32,
    /// Numbers of the frames in which the mass is held and still stands; None: the longest part in which nothing moves.
    pub held: Option<Range<u64>>,
    /// Numbers of the frames in which it hangs; None: those at the end in which nothing moves.
    pub hanging: Option<Range<u64>>,
    /// Name of the recording in the provenance.
    pub recording: String,
}

/// A shear stiffness with what it was measured from.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredShear {
    /// The stiffness.
    pub shear: Shear,
    /// Torn frames, which were left out.
    pub torn_count: usize,
    /// Which was the first of them, and why.
    pub first_torn: Option<String>,
    /// Frames of another size than those of the start, which were left out.
    pub other_size_count: usize,
    /// Which was the first of them, and its size.
    pub first_of_other_size: Option<String>,
}

/// Why a recording gives no shear stiffness.
#[derive(Debug, thiserror::Error)]
pub enum HangingMassError {
    /// The source failed.
    #[error("{0}")]
    Source(SourceError),
    /// The data of a frame do not match its size.
    #[error(transparent)]
    Frame(#[from] ImageError),
    /// No complete frame arrived.
    #[error("expected a recording, got no whole frame")]
    NoFrame,
    /// The sensor does not fit the frames.
    #[error(transparent)]
    Sensor(#[from] SettingError),
    /// The first frames give no rest frame.
    #[error(transparent)]
    Rest(#[from] RestError),
    /// Its markers are not those of the sensor.
    #[error("{0}")]
    OtherFinger(Reason),
    /// The finger is never seen untouched.
    #[error("expected a recording that begins with the finger untouched, got one that begins in contact")]
    InContact,
    /// A range of frames that the recording does not have.
    #[error("{option} {}..{}: expected frames of the recording, got one that ends before frame {}", range.start, range.end, range.end - 1)]
    BeyondEnd {
        /// `--held` or `--hanging`.
        option: &'static str,
        /// The frames asked for.
        range: Range<u64>,
    },
    /// The held and the hanging frames give no stiffness.
    #[error(transparent)]
    Shear(#[from] ShearError),
    /// No gel is that soft or stiff: another mass hangs there.
    #[error(
        "--weight-g {mass_g}: expected grams that give a stiffness from {low:.4} to {high:.1} N per marker and pitch, \
         got {got:.6} (is it the mass in grams, and are the --fingers those that share it?)",
        low = expected_n_per_pitch[0],
        high = expected_n_per_pitch[1]
    )]
    Implausible {
        /// The mass, g.
        mass_g: f64,
        /// The plausible range, N per marker and pitch.
        expected_n_per_pitch: [f64; 2],
        /// The stiffness that results.
        got: f64,
    },
}

impl HangingMass {
    /// Judges the recording to its end and measures.
    pub fn measure(&self, source: &mut ReadAhead, sensor: &Sensor) -> Result<MeasuredShear, HangingMassError> {
        let mut monitor = monitor_from_start(source, sensor)?;
        let outermost = outermost(monitor.sensor(), monitor.markers());
        let (mut reports, mut markers, mut torn_count, mut first_torn) = (Vec::new(), Vec::new(), 0, None);
        let (size, mut other_size_count, mut first_of_other_size) = (monitor.sensor().image_px, 0, None);
        let (mut buffer, mut frames_count) = (FrameBuffer::default(), 0);
        loop {
            let next = source.next(&mut buffer).map_err(HangingMassError::Source)?;
            if !matches!(next, Next::End | Next::Silent) {
                frames_count = buffer.seq + 1;
            }
            match next {
                Next::End => break,
                Next::Silent => {}
                Next::Torn { reason } => {
                    torn_count += 1;
                    first_torn.get_or_insert_with(|| torn(&buffer, &reason));
                }
                Next::Frame if buffer.size != size => {
                    other_size_count += 1;
                    first_of_other_size.get_or_insert_with(|| of_other_size(&buffer, size));
                }
                Next::Frame => {
                    reports.push(monitor.step(&buffer.frame()?, None));
                    markers.push(monitor.markers().to_vec());
                }
            }
        }
        for (option, range) in [("--held", &self.held), ("--hanging", &self.hanging)] {
            if let Some(range) = range.clone().filter(|range| range.end > frames_count) {
                return Err(HangingMassError::BeyondEnd { option, range });
            }
        }
        let frame = |(at, report)| HangingFrame::new(report, &steadied(&markers, at), &outermost);
        let frames: Vec<HangingFrame> = reports.iter().enumerate().map(frame).collect();
        let within = |range: &Range<u64>| frames.iter().filter(|f| range.contains(&f.seq)).copied().collect::<Vec<_>>();
        let hanging = self.hanging.as_ref().map_or_else(|| stationary_end(&frames).to_vec(), within);
        let first_seq = hanging.first().map_or(u64::MAX, |f| f.seq);
        let before: Vec<HangingFrame> = frames.iter().take_while(|f| f.seq < first_seq).copied().collect();
        let held = self.held.as_ref().map_or_else(|| stationary_held(&before, &hanging).to_vec(), within);
        let (mass_g, fingers_count) = (self.mass_g, self.fingers_count);
        let shear = shear_stiffness(monitor.sensor(), &held, &hanging, mass_g, fingers_count, &self.recording)?;
        let (expected_n_per_pitch, got) = (plausible_n_per_pitch(sensor), shear.stiffness_n_per_pitch);
        if !(expected_n_per_pitch[0]..=expected_n_per_pitch[1]).contains(&got) {
            return Err(HangingMassError::Implausible { mass_g, expected_n_per_pitch, got });
        }
        Ok(MeasuredShear { shear, torn_count, first_torn, other_size_count, first_of_other_size })
    }
}

/// The plausible stiffness of a gel, N per marker and pitch.
fn plausible_n_per_pitch(sensor: &Sensor) -> [f64; 2] {
    let pitches_mm = sensor.pitch_mm.map_or(PITCHES_MM, |pitch_mm| [pitch_mm; 2]);
    [0, 1].map(|i| GEL_MPA_PER_MM[i] * pitches_mm[i].powi(3))
}

/// A monitor whose rest frame is the start of the recording, untouched.
fn monitor_from_start(source: &mut ReadAhead, sensor: &Sensor) -> Result<SlipMonitor, HangingMassError> {
    // The stiffness is not known yet, and without it markers show slip more reliably than an estimate.
    let settings = Settings::default().with(|s| s.slip.rule = SlipRule::Markers);
    let window_count = settings.rest.window_count as usize;
    let whole = source.read_ahead(window_count).filter(|ahead| ahead.torn.is_none()).map(|ahead| &ahead.buffer);
    let whole: Vec<&FrameBuffer> = whole.collect();
    let size = most_common_size(whole.iter().copied()).ok_or(HangingMassError::NoFrame)?;
    let mut finder = RestFinder::new(sensor, &settings, size)?;
    for buffer in whole {
        finder.see(buffer)?;
    }
    let rest = finder.find()?.rest;
    // Before the kind: an untouched finger taken for another one may look touched.
    if let Some(reason) = rest.refusal() {
        return Err(HangingMassError::OtherFinger(reason));
    }
    match rest.kind() {
        RestKind::InContact => Err(HangingMassError::InContact),
        RestKind::Unloaded => Ok(SlipMonitor::new(sensor, &settings, rest)?),
    }
}
