//! The page that shows a judged recording: one self-contained file without script. It looks like that of a run.
//!
//! ```text
//!   title, totals
//!   strip: state of every frame          |  one time axis,
//!   plots: contact, motion, slip, margin |  slips numbered through all of them
//!   a card for each slip, with its first frame
//!   events, settings (folded)
//! ```

use super::panels::{Line, Panel, Stroke};
use super::phases::stretches;
use super::plot::{Mark, Timeline};
use super::strips::{self, Row};
use super::text::seconds;
use super::time_axis::{TimeAxis, TimeUnit};
use super::{PICTURES_MOST, head_of_page};
use crate::html_page::markup::{Escaped, base64};
use crate::html_page::picture;
use crate::overlay::{FrameCopy, Overlay};
use crate::printable::without_passwords;
use crate::report_summary::{ReportSummary, state_name};
use crate::run::thinned::Thinned;
use slipbound::events::SlipEvent;
use slipbound::monitor::{Estimate, Reason, SlipMonitor, SlipReport, SlipState};
use slipbound::plane::Vec2;
use slipbound::port::FrameBuffer;
use slipbound::sensor::Sensor;
use std::fmt;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

/// Times that begin later are wall-clock times: they are counted from the first frame.
const CLOCK_FROM_NS: u64 = 3_600_000_000_000;

/// Frames from which a page is drawn: of a longer recording, as of a camera over a day, one of two, one of four ..
const REPORTS_MOST: usize = 1 << 16;

/// Of two frames, the one with the larger deviation from rigid motion.
fn worse(a: SlipReport, b: SlipReport) -> (SlipReport, bool) {
    if b.slip.max_pitch > a.slip.max_pitch { (b, true) } else { (a, false) }
}

/// Collects what the page shows, frame by frame.
pub struct RecordingPage {
    source: String,
    below: String,
    settings: String,
    /// px of the rectified image a marker pitch, and mm, where that is known.
    pitch: (f64, Option<f64>),
    alarm_margin: Option<f64>,
    pictures: Pictures,
    reports: Thinned<SlipReport>,
    /// Those that the page shows.
    shown: Vec<SlipReport>,
    events: Vec<(Place, String)>,
    slips: Vec<Slip>,
}

/// Number and time of a frame.
type Place = (u64, Option<u64>);

struct Slip {
    number: u32,
    place: Place,
    title: String,
    jpeg: Option<Vec<u8>>,
}

/// Draws the pictures of slips on a thread of its own: the next frame is not to wait for one.
struct Pictures {
    to_draw: Sender<FrameCopy>,
    drawn: Receiver<Option<Vec<u8>>>,
    waiting_count: usize,
}

impl Pictures {
    fn new(sensor: &Sensor) -> Self {
        let (to_draw, jobs) = channel::<FrameCopy>();
        let (give, drawn) = channel();
        let sensor = sensor.clone();
        thread::spawn(move || {
            let mut overlay = None;
            for job in jobs {
                let overlay = overlay.get_or_insert_with(|| Overlay::new(&sensor).for_stills());
                job.draw(overlay);
                let size = overlay.size();
                let jpeg = picture::jpeg(&overlay.rgb(), size.width as u32, size.height as u32);
                if give.send(jpeg.ok()).is_err() {
                    return;
                }
            }
        });
        Pictures { to_draw, drawn, waiting_count: 0 }
    }

    fn draw(&mut self, frame: &FrameBuffer, report: &SlipReport, monitor: &SlipMonitor) {
        let mut copy = FrameCopy::default();
        copy.take(Some(frame), report, &monitor.into());
        self.waiting_count += usize::from(self.to_draw.send(copy).is_ok());
    }

    /// The next picture, in the order of the frames; None where there is none.
    fn next(&mut self) -> Option<Vec<u8>> {
        self.waiting_count = self.waiting_count.checked_sub(1)?;
        self.drawn.recv().ok().flatten()
    }
}

/// Page and totals, as text.
struct PageText<'a>(&'a RecordingPage, &'a ReportSummary);

impl RecordingPage {
    /// Before the first frame. `below`: text under the title, beside the finger.
    pub fn new(source: &str, finger: &str, below: Option<&str>, monitor: &SlipMonitor) -> Self {
        let sensor = monitor.sensor();
        let table = |text: Result<String, toml::ser::Error>| text.unwrap_or_else(|e| e.to_string());
        let settings = table(toml::to_string_pretty(monitor.settings()));
        let below = below.map_or_else(String::new, |below| format!("; {below}"));
        RecordingPage {
            source: without_passwords(source).into_owned(),
            below: format!("{finger}: sensor {}{below}", sensor.name),
            settings: format!("{settings}\n# the finger\n{}", table(toml::to_string_pretty(sensor))),
            pitch: (sensor.pitch_px, sensor.pitch_mm),
            alarm_margin: monitor.settings().slip.alarm_margin(),
            pictures: Pictures::new(sensor),
            reports: Thinned::new(REPORTS_MOST, worse),
            shown: Vec::new(),
            events: Vec::new(),
            slips: Vec::new(),
        }
    }

    /// Takes a frame and the report on it.
    pub fn see(&mut self, report: &SlipReport) {
        self.reports.push(*report);
    }

    /// Takes an event of the frame judged last, in words.
    pub fn event(&mut self, event: &SlipEvent, words: &str, frame: &FrameBuffer, monitor: &SlipMonitor) {
        let place = match *event {
            SlipEvent::Begins { seq, time_ns, .. } | SlipEvent::Ends { seq, time_ns, .. } => (seq, time_ns),
        };
        self.events.push((place, words.to_owned()));
        let (SlipEvent::Begins { slip, .. }, Some((_, report))) = (*event, &self.reports.last) else { return };
        if self.slips.len() < PICTURES_MOST {
            self.pictures.draw(frame, report, monitor);
        }
        self.slips.push(Slip { number: slip, place, title: words.to_owned(), jpeg: None });
    }

    /// The page, with the totals of the same frames.
    pub fn html(&mut self, summary: &ReportSummary) -> String {
        for slip in self.slips.iter_mut().take(PICTURES_MOST).filter(|slip| slip.jpeg.is_none()) {
            slip.jpeg = self.pictures.next();
        }
        self.shown = self.reports.all();
        PageText(self, summary).to_string()
    }

    /// Whether frames carry times; where a whole one does not, all are shown by number. A torn one may have lost its own.
    fn has_times(&self) -> bool {
        let lacks_time = |report: &SlipReport| report.time_ns.is_none() && report.reason != Some(Reason::Torn);
        self.times_ns().next().is_some() && !self.shown.iter().any(lacks_time)
    }

    fn times_ns(&self) -> impl DoubleEndedIterator<Item = u64> {
        self.shown.iter().filter_map(|report| report.time_ns)
    }

    fn origin_ns(&self) -> u64 {
        self.times_ns().next().filter(|first_ns| *first_ns > CLOCK_FROM_NS).unwrap_or(0)
    }

    /// Position of a frame on the axis.
    fn at_ns(&self, (seq, time_ns): Place) -> u64 {
        match time_ns.filter(|_| self.has_times()) {
            Some(time_ns) => time_ns.saturating_sub(self.origin_ns()),
            None => seq.saturating_mul(1_000_000_000),
        }
    }

    fn timeline(&self) -> Option<Timeline> {
        let unit = if self.has_times() { TimeUnit::Seconds } else { TimeUnit::Frames };
        // A torn frame without a time stands at that of the one before it.
        let mut before_ns = self.times_ns().next();
        let place = |report: &SlipReport| {
            before_ns = report.time_ns.or(before_ns);
            self.at_ns((report.seq, before_ns))
        };
        let times_ns: Vec<u64> = self.shown.iter().map(place).collect();
        let axis = TimeAxis::over(*times_ns.first()?, *times_ns.last()?, unit);
        let states = self.shown.iter().map(|report| shown(report.state));
        let band = stretches(times_ns.iter().copied().zip(states));
        let mark = |slip: &Slip| Mark { slip: slip.number, time_ns: self.at_ns(slip.place), title: slip.title.clone() };
        Some(Timeline { axis, times_ns, band, marks: self.slips.iter().map(mark).collect() })
    }

    fn panels(&self) -> Vec<Panel> {
        use Stroke::{Area, Dashed, Solid};
        let (pitch_px, pitch_mm) = self.pitch;
        // Lengths are in mm where the finger's pitch is known, else in pitches.
        let unit = |mm, pitches| if pitch_mm.is_some() { mm } else { pitches };
        let scale = pitch_mm.unwrap_or(1.0) / pitch_px;
        let line = |name, colour, stroke, value: &dyn Fn(&SlipReport) -> Option<f64>| {
            let values = self.shown.iter().map(|report| value(report).filter(|value| value.is_finite()));
            Line { name, colour, stroke, values: values.collect() }
        };
        let panel = Panel::new;
        let moved = |part: fn(Vec2) -> f64| {
            move |r: &SlipReport| r.motion.as_ref().map(|motion| scale * part(motion.translation_px))
        };
        let value = |estimate: Option<Estimate>| estimate.map(|estimate| estimate.value);
        let mut panels = vec![
            panel(
                "Slip: largest deviation of a marker from rigid motion",
                unit("mm", "marker pitches"),
                190.0,
                3,
                vec![line("", "--c2", Area, &|r| r.motion.map(|_| pitch_mm.unwrap_or(1.0) * r.slip.max_pitch))],
            ),
            panel(
                "Contact area",
                unit("mm\u{b2}", "square pitches"),
                150.0,
                1,
                vec![line("", "--c3", Area, &|r| {
                    (r.state != SlipState::Unjudged).then_some(scale * scale * r.contact.area_px2)
                })],
            ),
            panel(
                "Motion of the contact",
                unit("mm", "marker pitches"),
                150.0,
                3,
                vec![
                    line("along the finger (x)", "--c1", Solid, &moved(|v| v.x)),
                    line("across it (y)", "--c4", Solid, &moved(|v| v.y)),
                ],
            ),
            panel(
                "Rotation of the contact",
                "deg",
                150.0,
                2,
                vec![line("", "--c1", Solid, &|r| r.motion.map(|motion| motion.rotation_rad.to_degrees()))],
            ),
            Panel {
                bounds: (-0.3, 1.0),
                shown: (0.0, 1.0),
                ..panel(
                    "Slip margin and stick ratio",
                    "fraction",
                    170.0,
                    2,
                    vec![
                        line("stick ratio", "--c4", Dashed, &|r| value(r.estimates.stick_ratio)),
                        line("margin", "--c1", Solid, &|r| value(r.estimates.margin)),
                        line("alarm (without grip force: of the mean over 80 ms)", "--c2", Dashed, &|r| {
                            value(r.estimates.margin).and(self.alarm_margin)
                        }),
                    ],
                )
            },
            panel("Shear force", "N", 150.0, 2, vec![line("", "--c1", Solid, &|r| value(r.estimates.shear_n))]),
        ];
        for panel in &mut panels {
            panel.lines.retain(|line| line.values.iter().any(Option::is_some));
        }
        panels.retain(|panel| !panel.lines.is_empty());
        panels
    }

    fn facts(&self, summary: &ReportSummary) -> Vec<(String, &'static str)> {
        let mut facts = Vec::new();
        let ends = self.times_ns().next().zip(self.times_ns().next_back());
        if let Some((first_ns, last_ns)) = ends.filter(|_| self.has_times()) {
            facts.push((seconds(last_ns.saturating_sub(first_ns)), "from the first frame to the last"));
        }
        let plural = |count: u64, one: &'static str, more: &'static str| if count == 1 { one } else { more };
        facts.push((summary.frames_count().to_string(), plural(summary.frames_count(), "frame", "frames")));
        facts.push((self.slips.len().to_string(), plural(self.slips.len() as u64, "slip", "slips")));
        if summary.torn_count() > 0 {
            facts.push((summary.torn_count().to_string(), "torn"));
        }
        facts
    }
}

impl fmt::Display for PageText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PageText(page, summary) = self;
        let title = Escaped(&page.source);
        head_of_page(f, &page.source)?;
        writeln!(f, "<header>\n<p class=\"above\">Slipbound recording</p>\n<h1 class=\"source\">{title}</h1>")?;
        writeln!(f, "<p class=\"below\">{}</p>", Escaped(&page.below))?;
        for line in summary.lines() {
            writeln!(f, "<p class=\"ending\">{}.</p>", Escaped(&line))?;
        }
        writeln!(f, "<ul class=\"facts\">")?;
        page.facts(summary).iter().try_for_each(|(value, name)| writeln!(f, "<li><b>{value}</b> {name}</li>"))?;
        writeln!(f, "</ul>\n</header>\n<section>\n<h2>Over time</h2>")?;
        match page.timeline() {
            None => writeln!(f, "<p>No frame was judged.</p>")?,
            Some(timeline) => {
                let some = |stretch: &super::phases::Stretch<super::phases::ClassAndName>| super::phases::Stretch {
                    what: Some(stretch.what),
                    from_ns: stretch.from_ns,
                    to_ns: stretch.to_ns,
                };
                let rows = [("state".to_owned(), Row::Bands(timeline.band.iter().map(some).collect()))];
                strips::write(f, &timeline.axis, "States", &rows)?;
                let panels = page.panels();
                for (i, panel) in panels.iter().enumerate() {
                    timeline.write(f, panel, i, i + 1 == panels.len())?;
                }
            }
        }
        writeln!(f, "</section>\n<section>\n<h2>What the finger saw</h2>")?;
        match page.slips.is_empty() {
            true => writeln!(f, "<p>No slip was seen.</p>")?,
            false => writeln!(f, "{}", super::KEY)?,
        }
        for (i, slip) in page.slips.iter().enumerate() {
            if i == PICTURES_MOST {
                writeln!(
                    f,
                    "<p class=\"key\">Pictures of the first {i} slips only: the page has no room for more. \
                     <code>--overlay</code> shows every frame.</p>"
                )?;
            }
            let (number, title) = (slip.number, Escaped(&slip.title));
            writeln!(f, "<article id=\"slip-{number}\">\n<h3><span class=\"badge\">{number}</span> {title}</h3>")?;
            if let Some(jpeg) = &slip.jpeg {
                writeln!(
                    f,
                    "<figure><img alt=\"slip {number}\" src=\"data:image/jpeg;base64,{}\"/></figure>",
                    base64(jpeg)
                )?;
            }
            writeln!(f, "</article>")?;
        }
        writeln!(f, "</section>\n<section>\n<details>\n<summary>All events</summary>\n<table>")?;
        for (_, words) in &page.events {
            writeln!(f, "<tr><td>{}</td></tr>", Escaped(words))?;
        }
        writeln!(f, "</table>\n</details>\n<details>\n<summary>Settings</summary>")?;
        writeln!(f, "<pre>{}</pre>\n</details>\n</section>", Escaped(&page.settings))?;
        let clock = if page.origin_ns() > 0 { " The plots count time from the first frame." } else { "" };
        writeln!(f, "<footer>slipbound {}.{clock}</footer>\n</main>\n</body>\n</html>", env!("CARGO_PKG_VERSION"))
    }
}

/// Class of the style sheet and name of a state.
fn shown(state: SlipState) -> (&'static str, &'static str) {
    let class = match state {
        SlipState::NoContact => "no-contact",
        SlipState::Unsure => "unsure",
        SlipState::Stick => "stick",
        SlipState::Incipient => "incipient",
        SlipState::Gross => "gross",
        SlipState::Unjudged => "unjudged",
    };
    (class, state_name(state))
}
