//! The page that shows a run: one self-contained file without script.
//!
//! ```text
//!   title, how it ended and why
//!   table of results
//!   strips: phases, fingers, notes      |  one time axis,
//!   plots: force, load, margin, shear   |  slips numbered through all of them
//!   a card for each slip, with what the fingers saw
//!   events, settings (folded)
//! ```
//!
//! It is well-formed XML as well as HTML, which is how the tests read it.

mod panels;
mod phases;
pub(super) mod picture;
mod plot;
pub(super) mod recording;
mod strips;
mod text;
mod time_axis;

use super::event::{Event, TimedEvent};
use super::info::{Row, RunInfo};
use super::words::duration;
use crate::html_page::markup::{Escaped, base64};
use slipbound::control::Cycle;
use slipbound::task::Ending;
use std::fmt;
use text::{evidence, in_words, seconds};

/// Images put into the page; later ones of a run are only in the folder. 60 of them are some 6 MB.
pub(super) const PICTURES_MOST: usize = 60;

/// Legend of the arrows in the images.
const KEY: &str = "<p class=\"key\">Arrows on the left: <span class=\"measured\">yellow</span> measured, \
                   <span class=\"rigid\">light blue</span> as a rigid body would move. On the right: black the difference, \
                   <span class=\"slipping\">purple</span> the markers whose slip is over the paper's threshold. By \
                   default the margin raises the alarm, not their number: it can come before any is purple, and not \
                   come where many are.</p>";

/// What a picture is, and whose time is in it.
const PICTURES_KEY: &str = "<p class=\"key\">A click enlarges a picture. Frame and time in it are those of its source; every \
                            other time on this page is the control loop's.</p>";

/// The image of a finger at a slip.
#[derive(Debug)]
pub(super) struct Picture {
    pub slip: u32,
    pub finger: String,
    pub caption: String,
    pub file: String,
    pub jpeg: Vec<u8>,
}

/// Everything the page shows.
pub(super) struct Page<'a> {
    pub info: &'a RunInfo,
    /// The first and the last cycle, and between them as many as are drawn, those with the largest force.
    pub cycles: &'a [Cycle],
    /// The largest slip of a marker since the reference, in marker pitches, for every cycle; None where no image shows
    /// it.
    pub slips_pitch: &'a [Option<f64>],
    /// When the task ended, ns.
    pub ended_ns: Option<u64>,
    pub events: &'a [TimedEvent],
    /// After this many events, this many are left out.
    pub left_out: (usize, u64),
    pub slips_count: u32,
    /// The first ones.
    pub pictures: &'a [Picture],
    pub results: &'a [Row],
    pub ending: Option<Ending>,
}

impl fmt::Display for Page<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let title = format!("{}, controller {}", capital(&self.info.name), self.info.task_settings.controller);
        head_of_page(f, &title)?;
        self.head(f, &title)?;
        self.table(f)?;
        self.plots(f)?;
        self.slips(f)?;
        self.happened(f)?;
        self.settings(f)?;
        writeln!(f, "</main>\n</body>\n</html>")
    }
}

/// The start of a page up to its first words; `</main>`, `</body>` and `</html>` are to follow.
fn head_of_page(f: &mut fmt::Formatter<'_>, title: &str) -> fmt::Result {
    writeln!(f, "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>")?;
    writeln!(f, "<meta name=\"generator\" content=\"slipbound\"/>")?;
    writeln!(f, "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>")?;
    writeln!(f, "<meta name=\"color-scheme\" content=\"light dark\"/>")?;
    writeln!(f, "<title>{}</title>\n<style>{}</style>", Escaped(title), include_str!("page/style.css"))?;
    writeln!(f, "</head>\n<body>\n<main>")
}

impl Page<'_> {
    fn head(&self, f: &mut fmt::Formatter<'_>, title: &str) -> fmt::Result {
        writeln!(f, "<header>\n<p class=\"above\">Slipbound run</p>\n<h1>{}</h1>", Escaped(title))?;
        writeln!(f, "<p class=\"below\">{}</p>", Escaped(&self.info.source_in_words()))?;
        let (name, why) = match self.ending {
            Some(ending) => (ending.name(), ending.evidence()),
            None => ("Broken off", "the loop stopped before the task was over"),
        };
        // A task can end successfully although a target was missed.
        let missed = self.results.iter().filter(|row| row.ok == Some(false)).map(|row| row.name.as_str());
        let missed: Vec<&str> = missed.collect();
        let is_good = missed.is_empty() && self.ending.is_some_and(Ending::is_success);
        let class = if is_good { "good" } else { "bad" };
        write!(f, "<p class=\"ending {class}\"><strong>{}</strong>: {}", Escaped(name), Escaped(why))?;
        if !missed.is_empty() {
            write!(f, "; target missed: {}", Escaped(&missed.join(", ")))?;
        }
        writeln!(f, ".</p>")?;
        let commanded_n = self.cycles.iter().filter_map(|c| c.grip_command.force_n());
        let most_n = commanded_n.filter(|n| n.is_finite()).fold(0.0, f64::max);
        let last = self.cycles.last();
        let alarms_count = last.map_or(0, |c| c.alarms_count);
        let one_or = |count: u64, one, more| (count.to_string(), if count == 1 { one } else { more });
        let in_s = |ns: u64| ns as f64 * 1e-9;
        // On the same clock as slips, plots and events.
        let facts = [
            duration(self.ended_ns.map(in_s), last.map_or(0.0, |c| in_s(c.time_ns)), self.ending),
            one_or(self.slips_count.into(), "slip", "slips"),
            one_or(alarms_count.into(), "alarm of the controller", "alarms of the controller"),
            (format!("{most_n:.1} N"), "largest force commanded, per finger"),
            one_or(self.info.fingers.len() as u64, "finger", "fingers"),
        ];
        writeln!(f, "<ul class=\"facts\">")?;
        for (value, name) in facts {
            writeln!(f, "<li><b>{value}</b> {name}</li>")?;
        }
        writeln!(f, "</ul>\n</header>")
    }

    fn table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.results.is_empty() {
            return Ok(());
        }
        writeln!(f, "<section>\n<h2>Results</h2>\n<table class=\"results\">")?;
        writeln!(f, "<tr><th>Measure</th><th>Value</th><th>Target</th><th></th></tr>")?;
        for row in self.results {
            let (class, verdict) = match row.ok {
                Some(true) => ("good", "\u{2713} met"),
                Some(false) => ("bad", "\u{2717} missed"),
                None => ("", ""),
            };
            let [name, value, target] = [&row.name, &row.value, &row.target].map(|text| Escaped(text));
            writeln!(f, "<tr><td>{name}</td><td class=\"value\">{value}</td><td>{target}</td>")?;
            writeln!(f, "<td class=\"{class}\">{verdict}</td></tr>")?;
        }
        writeln!(f, "</table>\n</section>")
    }

    fn plots(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "<section>\n<h2>Over time</h2>")?;
        let Some(time) = time_axis::TimeAxis::of(self.cycles) else {
            return writeln!(f, "<p>No cycle was run.</p>\n</section>");
        };
        let mark =
            |(event, slip): (&TimedEvent, u32)| plot::Mark { slip, time_ns: event.time_ns, title: in_words(event) };
        let timeline = plot::Timeline {
            axis: time,
            times_ns: self.cycles.iter().map(|cycle| cycle.time_ns).collect(),
            band: phases::phases(self.cycles),
            marks: self.marks().map(mark).collect(),
        };
        strips::write(f, &time, "Phases", &strips::of_run(&self.info.finger_names(), self.cycles, self.events))?;
        let panels = panels::of(self.cycles, self.slips_pitch, self.info);
        for (i, panel) in panels.iter().enumerate() {
            timeline.write(f, panel, i, i + 1 == panels.len())?;
        }
        writeln!(f, "</section>")
    }

    fn slips(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let before: Vec<&Picture> = self.pictures.iter().filter(|p| p.slip == 0).collect();
        if before.is_empty() && self.slips_count == 0 {
            return writeln!(f, "<section>\n<h2>Slips</h2>\n<p>None was seen.</p>\n</section>");
        }
        writeln!(f, "<section>\n<h2>What the fingers saw</h2>")?;
        writeln!(f, "{KEY}\n{PICTURES_KEY}")?;
        if !before.is_empty() {
            writeln!(f, "<article>\n<h3>Before any slip</h3>")?;
            self.figures(f, 0)?;
            writeln!(f, "</article>")?;
        }
        for (event, slip) in self.marks() {
            writeln!(
                f,
                "<article id=\"slip-{slip}\">\n<h3><span class=\"badge\">{slip}</span> {}</h3>",
                Escaped(&in_words(event))
            )?;
            if let Some(evidence) = evidence(&event.event) {
                writeln!(f, "<p>{}</p>", Escaped(&evidence))?;
            }
            self.figures(f, slip)?;
            writeln!(f, "</article>")?;
        }
        writeln!(f, "</section>")
    }

    fn figures(&self, f: &mut fmt::Formatter<'_>, slip: u32) -> fmt::Result {
        let mut all = self.pictures.iter().filter(|p| p.slip == slip).peekable();
        if all.peek().is_none() && self.pictures.len() == PICTURES_MOST {
            return writeln!(
                f,
                "<p>What the fingers saw is in the folder alone: <code>slip_{slip:03}_*.png</code></p>"
            );
        }
        writeln!(f, "<div class=\"figures\">")?;
        for picture in all {
            writeln!(f, "<figure>")?;
            let (finger, caption, file) = (Escaped(&picture.finger), Escaped(&picture.caption), Escaped(&picture.file));
            let data = base64(&picture.jpeg);
            write!(f, "<label><input type=\"checkbox\" aria-label=\"enlarge\"/>")?;
            writeln!(f, "<img alt=\"{finger} finger, slip {slip}\" src=\"data:image/jpeg;base64,{data}\"/></label>")?;
            writeln!(f, "<figcaption><b>{finger}</b> {caption} <code>{file}</code></figcaption>\n</figure>")?;
        }
        writeln!(f, "</div>")
    }

    fn happened(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "<section>\n<details>\n<summary>All events</summary>\n<table>")?;
        let (place, left_out_count) = self.left_out;
        for (i, event) in self.events.iter().enumerate() {
            if i == place && left_out_count > 0 {
                writeln!(f, "<tr><td></td><td>{left_out_count} more: in <code>events.jsonl</code></td></tr>")?;
            }
            let time = seconds(event.time_ns);
            let words = in_words(event) + &evidence(&event.event).map_or_else(String::new, |why| format!("; {why}"));
            writeln!(f, "<tr><td class=\"value\">{time}</td><td>{}</td></tr>", Escaped(&words))?;
        }
        writeln!(f, "</table>\n</details>")
    }

    fn settings(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.info.table().and_then(|table| toml::to_string_pretty(&table)).map_err(|_| fmt::Error)?;
        writeln!(f, "<details>\n<summary>Settings</summary>\n<pre>{}</pre>\n</details>\n</section>", Escaped(&text))?;
        writeln!(
            f,
            "<footer>slipbound {}. Beside this page: <code>reports.jsonl</code> every cycle, <code>events.jsonl</code>, \
             <code>run.toml</code>. Newtons are normal force per finger.</footer>",
            env!("CARGO_PKG_VERSION")
        )
    }

    /// Every slip and its number.
    fn marks(&self) -> impl Iterator<Item = (&TimedEvent, u32)> {
        self.events.iter().filter_map(|event| match event.event {
            Event::SlipBegins { slip, .. } => Some((event, slip)),
            _ => None,
        })
    }
}

fn capital(word: &str) -> String {
    let mut signs = word.chars();
    signs.next().map_or_else(String::new, |first| first.to_uppercase().chain(signs).collect())
}
