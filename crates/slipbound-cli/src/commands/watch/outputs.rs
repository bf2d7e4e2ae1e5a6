//! Outputs for a frame's report: JSON lines, table, slips, page, overlay, timings.

use super::args::Watch;
use crate::outcome::Failure;
use slipbound::events::SlipEvent;
use slipbound::monitor::{Reason, SlipMonitor, SlipReport};
use slipbound::port::{Clock, FrameBuffer};
use slipbound_rig::avi_writer::MAX_BYTES;
use slipbound_rig::container::{McapAnnotations, Recorder, ReportLines};
use slipbound_rig::line_file::LineFile;
use slipbound_rig::overlay::{self, Drawn, OverlayOptions, OverlayWriter};
use slipbound_rig::report_csv::ReportCsv;
use slipbound_rig::report_json::{Header, ReportJson, RestOrigin};
use slipbound_rig::report_slips::ReportSlips;
use slipbound_rig::report_summary::ReportSummary;
use slipbound_rig::run::RecordingPage;
use slipbound_rig::timings::{Stopwatch, Timings};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Content of the report's header beyond arguments, finger and settings.
pub struct Origin {
    /// Whose clock.
    pub clock: Clock,
    /// What the rest frame was made from.
    pub rest: RestOrigin,
    /// What a reader should know.
    pub note: Option<String>,
    /// Playback rate of a video, frames per second.
    pub rate_hz: u32,
}

/// Every requested output.
pub struct Outputs {
    /// Measures the steps while a frame is judged.
    pub stopwatch: Stopwatch,
    json: Option<Json>,
    csv: Option<(PathBuf, ReportCsv<LineFile>)>,
    recorded: Option<(ReportJson<ReportLines>, McapAnnotations)>,
    finger: String,
    slips: Option<(PathBuf, ReportSlips<LineFile>)>,
    page: Option<(PathBuf, RecordingPage)>,
    overlay: Option<OverlayWriter>,
    overlay_limit_bytes: u64,
    overlay_is_whole: bool,
    timings: Option<Timings>,
}

/// The report as JSON lines.
struct Json {
    path: PathBuf,
    lines: ReportJson<Box<dyn Write>>,
    markers: bool,
}

impl Outputs {
    /// Creates the requested files.
    pub fn open(
        args: &Watch,
        origin: Origin,
        monitor: &SlipMonitor,
        recorder: Option<&Recorder>,
    ) -> Result<Self, Failure> {
        // The page is written at the end, but an unwritable place is reported before the first frame.
        args.report.iter().try_for_each(|path| refuse_unwritable(path).map_err(|e| cannot_write(path, e)))?;
        let page = args.report.as_ref().map(|path| {
            (path.clone(), RecordingPage::new(&args.source, &args.finger, origin.note.as_deref(), monitor))
        });
        let header = Header {
            finger: &args.finger,
            sensor: monitor.sensor(),
            settings: monitor.settings(),
            source: &args.source,
            clock: origin.clock,
            rest: origin.rest,
            note: origin.note,
        };
        let waits = !slipbound_rig::source::is_live(&args.source);
        let recorded = recorder.map(|r| {
            let lines = ReportJson::new(ReportLines::new(r.inlet(), &args.finger, waits), &header)?;
            Ok((lines, McapAnnotations::new(r.inlet(), waits)))
        });
        let recorded = recorded.transpose().map_err(|e: io::Error| Failure::work("record", e))?;
        let json = match &args.json {
            None => None,
            Some(path) => {
                let failed = |e| cannot_write(path, e);
                let to: Box<dyn Write> = match args.json_on_stdout() {
                    true => Box::new(io::stdout()),
                    false => Box::new(LineFile::create(path).map_err(failed)?),
                };
                let lines = ReportJson::new(to, &header).map_err(failed)?;
                Some(Json { path: path.clone(), lines, markers: args.markers })
            }
        };
        let csv = match &args.csv {
            None => None,
            Some(path) => {
                let table = LineFile::create(path).and_then(|file| ReportCsv::new(file, &args.finger));
                Some((path.clone(), table.map_err(|e| cannot_write(path, e))?))
            }
        };
        let slips = match &args.slips {
            None => None,
            Some(path) => {
                let file = LineFile::create(path).map_err(|e| cannot_write(path, e))?;
                Some((path.clone(), ReportSlips::new(file, &args.finger)))
            }
        };
        let overlay_limit_bytes = args.overlay_most_bytes.unwrap_or(MAX_BYTES);
        let overlay = match &args.overlay {
            None => None,
            Some(to) => {
                let most_bytes = overlay_limit_bytes;
                let options = OverlayOptions { rate_hz: origin.rate_hz, most_bytes, waits };
                Some(OverlayWriter::create(to, monitor.sensor(), options).map_err(cannot_draw)?)
            }
        };
        let timings = match &args.timings {
            None => None,
            Some(path) => Some(Timings::create(path).map_err(|e| cannot_write(path, e))?),
        };
        let finger = args.finger.clone();
        Ok(Outputs {
            stopwatch: Stopwatch::new(),
            json,
            csv,
            recorded,
            finger,
            slips,
            page,
            overlay,
            overlay_limit_bytes,
            overlay_is_whole: true,
            timings,
        })
    }

    /// Whether every frame was drawn, as far as is known.
    pub fn overlay_is_whole(&self) -> bool {
        self.overlay_is_whole
    }

    /// Writes the report of a frame. Returns what the user should know about an output that ends with it.
    pub fn write(
        &mut self,
        frame: &FrameBuffer,
        report: &SlipReport,
        monitor: &SlipMonitor,
    ) -> Result<Option<String>, Failure> {
        if let Some(timings) = &mut self.timings {
            let written = timings.write(report, &self.stopwatch);
            written.map_err(|e| cannot_write(timings.path(), e))?;
        }
        if let Some(json) = &mut self.json {
            let field = json.markers.then(|| monitor.into());
            json.lines.frame(report, field).map_err(|e| cannot_write(&json.path, e))?;
        }
        if let Some((path, table)) = &mut self.csv {
            table.frame(report).map_err(|e| cannot_write(path, e))?;
        }
        if let Some((lines, annotations)) = &mut self.recorded {
            lines.frame(report, None).map_err(|e| Failure::work("record", e))?;
            if report.reason != Some(Reason::Torn) {
                annotations.record(&self.finger, frame, report, monitor);
            }
        }
        if let Some((path, slips)) = &mut self.slips {
            slips.frame(report).map_err(|e| cannot_write(path, e))?;
        }
        if let Some((_, page)) = &mut self.page {
            page.see(report);
        }
        self.draw(frame, report, monitor)
    }

    /// Has a frame drawn. When nothing more can be drawn the overlay is finished.
    fn draw(
        &mut self,
        frame: &FrameBuffer,
        report: &SlipReport,
        monitor: &SlipMonitor,
    ) -> Result<Option<String>, Failure> {
        let Some(overlay) = &mut self.overlay else { return Ok(None) };
        let whole = (report.reason != Some(Reason::Torn)).then_some(frame);
        if overlay.push(whole, report, monitor) { Ok(None) } else { self.finish_overlay() }
    }

    /// Waits for the last picture. A video that is full ends, and the rest of the recording goes on without it: it can
    /// be drawn again, a camera cannot. Returns what the user should know.
    pub fn finish_overlay(&mut self) -> Result<Option<String>, Failure> {
        let Some(overlay) = self.overlay.take() else { return Ok(None) };
        let path = overlay.path().display().to_string();
        let Drawn { lost_count, full_at_seq } = overlay.finish().map_err(cannot_draw)?;
        self.overlay_is_whole &= lost_count == 0 && full_at_seq.is_none();
        let frames = if lost_count == 1 { "frame was" } else { "frames were" };
        let lost = (lost_count > 0).then(|| format!("{lost_count} {frames} not drawn: the drawing did not keep up"));
        let full = full_at_seq.map(|seq| {
            let full = format!("the video is full, {} bytes", self.overlay_limit_bytes);
            let advice = "--overlay FOLDER draws pictures without a limit";
            format!("{full}: it ends before frame {seq}, all else goes on ({advice})")
        });
        let notes: Vec<String> = full.into_iter().chain(lost).collect();
        Ok((!notes.is_empty()).then(|| format!("{path}: {}", notes.join("; "))))
    }

    /// An event of the frame written last, in words.
    pub fn event(&mut self, event: &SlipEvent, words: &str, frame: &FrameBuffer, monitor: &SlipMonitor) {
        if let Some((_, page)) = &mut self.page {
            page.event(event, words, frame, monitor);
        }
    }

    /// Finishes the files.
    pub fn close(self, summary: &ReportSummary) -> Result<(), Failure> {
        let slips = self.slips.map_or(Ok(()), |(path, slips)| slips.finish().map_err(|e| cannot_write(&path, e)));
        let page = self.page.map_or(Ok(()), |(path, mut page)| {
            fs::write(&path, page.html(summary)).map_err(|e| {
                if path.is_file() {
                    let _ = fs::remove_file(&path); // half a page is worthless
                }
                cannot_write(&path, e)
            })
        });
        slips.and(page)
    }
}

/// Fails where a file could not be written; creates none, and leaves an existing one unchanged.
fn refuse_unwritable(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(there) if !there.is_file() && !there.is_dir() => Ok(()), // a pipe: its reader would see its end
        Ok(_) => OpenOptions::new().write(true).open(path).map(drop),
        Err(_) => {
            drop(File::create_new(path)?);
            fs::remove_file(path)
        }
    }
}

fn cannot_draw(e: overlay::Error) -> Failure {
    Failure::Work(e.into())
}

fn cannot_write(path: &Path, e: io::Error) -> Failure {
    if path.as_os_str() == "-" && e.kind() == ErrorKind::BrokenPipe {
        return Failure::ReaderLeft;
    }
    Failure::work(format!("{}: cannot write", path.display()), e)
}
