//! Protocol `wriggles`: grasps that are lifted and shaken, recorded by both fingers; did the object slip out?
//!
//! ```text
//!   contact begins ---0.5 s---|<---- window: as long as the shortest clip leaves ---->|......  the rest does not count
//!                                highest causal score of both fingers
//! ```
//!
//! The length of a clip reveals its label (recording stops when the object is lost), so every clip is scored over the
//! same time. A finger that cannot be judged is left to the other; a grasp of which neither can be judged is named and
//! not counted.

use super::clip_record::note_of_uncounted;
use super::clip_verdict::judged;
use super::clip_watch::{RestFrom, Seen};
use super::clips::Clips;
use super::error::EvalError;
use super::lifts::row;
use super::protocol::Protocol;
use super::record::TrialRecord;
use super::statistics::share_of;
use super::table::{Cell, Table};
use crate::rivals::{DETECTORS, Entry, Inputs};
use slipbound::monitor::EvidenceSettings;
use slipbound::sensor::Sensor;
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Contact before the window, ns. Some recordings begin with the release of the grasp before: that contact ends sooner.
const CONTACT_NS: u64 = 500_000_000;

/// The same in frames, where they have no times: at 25 Hz.
const CONTACT_FRAMES_COUNT: u64 = 13;

/// Key of a record: how many videos of the grasp could not be judged; absent where all could.
const UNJUDGED_VIDEOS: &str = "unjudged_videos";

/// The protocol `wriggles`.
#[derive(Debug)]
pub struct Wriggles {
    clips: Clips,
    sensor: Sensor,
    jobs: usize,
    /// Results on every grasp, by finger and detector; computed together, because the shortest clip determines the
    /// window.
    seen: OnceLock<Result<Vec<Judged>, (usize, String)>>,
}

/// A grasp, or why it cannot be judged.
type Judged = Result<Grasp, String>;

/// Results of the detectors on a grasp.
#[derive(Debug)]
struct Grasp {
    /// By finger, then by detector; of the fingers that can be judged.
    fingers: Vec<Vec<Vec<Seen>>>,
    /// Videos that cannot be judged.
    unjudged_count: usize,
    /// Number of the first frame of the window; None without contact, or where no frame comes after it.
    from: Option<u64>,
    /// Frames from there to the end, those that the recorder dropped included.
    left_count: u64,
}

impl Wriggles {
    /// Its name on the command line and in files.
    pub const NAME: &'static str = "wriggles";

    /// The grasps of a folder, from a finger; this many are judged at a time.
    pub fn new(clips: Clips, sensor: Sensor, jobs: usize) -> Self {
        Wriggles { clips, sensor, jobs, seen: OnceLock::new() }
    }

    /// Every grasp, for the trial of one of them.
    fn all(&self, number: u64, detectors: &[&'static Entry]) -> Result<&[Judged], EvalError> {
        let all = self.seen.get_or_init(|| self.see_all(detectors));
        all.as_deref().map_err(|(failed, text)| match *failed as u64 == number {
            true => EvalError::other(text.clone()),
            false => EvalError::other(format!("the window is that of the shortest grasp: {text}")),
        })
    }

    /// The error comes with the index of its grasp.
    fn see_all(&self, detectors: &[&'static Entry]) -> Result<Vec<Judged>, (usize, String)> {
        let (detectors, contact_by) = &with_contact(detectors);
        let next = AtomicUsize::new(0);
        let names = &self.clips.names;
        let worker = || {
            let mut mine = Vec::new();
            loop {
                let n = next.fetch_add(1, Ordering::Relaxed);
                let Some(name) = names.get(n) else { return mine };
                let path = self.clips.path(name);
                let judged = match grasp(&self.clips, &path, &self.sensor, detectors, *contact_by) {
                    Err(EvalError::Unjudged { problem, .. }) => Ok(Err(problem)),
                    Err(error) => Err(format!("{}: {error}", path.display())),
                    Ok(grasp) => Ok(Ok(grasp)),
                };
                mine.push((n, judged));
            }
        };
        let mut done: Vec<(usize, Result<Judged, String>)> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..self.jobs.clamp(1, names.len().max(1))).map(|_| scope.spawn(worker)).collect();
            threads.into_iter().flat_map(|thread| thread.join().unwrap_or_default()).collect()
        });
        done.sort_by_key(|(n, _)| *n);
        if done.len() != names.len() {
            return Err((0, "a thread ended early".into()));
        }
        done.into_iter().map(|(n, grasp)| grasp.map_err(|text| (n, text))).collect()
    }
}

/// The detectors, and which of them tells when contact begins: one whose contact is ours, the first of [`DETECTORS`] if
/// none was asked for. The window is then the same whoever is asked.
fn with_contact(detectors: &[&'static Entry]) -> (Vec<&'static Entry>, usize) {
    let mut detectors = detectors.to_vec();
    let is_ours = |entry: &&'static Entry| entry.inputs != Inputs::PaperFrames;
    let contact_by = detectors.iter().position(is_ours).unwrap_or_else(|| {
        detectors.push(&DETECTORS[0]);
        detectors.len() - 1
    });
    (detectors, contact_by)
}

/// Runs the detectors on both fingers' recordings of a grasp.
fn grasp(
    clips: &Clips,
    folder: &Path,
    sensor: &Sensor,
    detectors: &[&'static Entry],
    contact_by: usize,
) -> Result<Grasp, EvalError> {
    let mut videos = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(EvalError::other)? {
        let path = entry.map_err(EvalError::other)?.path();
        let is_hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        if !is_hidden && path.extension().is_some_and(|extension| extension == "avi") {
            videos.push(path);
        }
    }
    videos.sort();
    let unjudged = |problem| EvalError::Unjudged { path: folder.to_owned(), problem };
    if videos.is_empty() {
        return Err(unjudged("expected a video of each finger, *.avi, got none".into()));
    }
    let (mut fingers, mut problems) = (Vec::new(), Vec::new());
    for video in &videos {
        match clips.watch(video, sensor, RestFrom::FirstFrames, detectors) {
            Ok(seen) => fingers.push(seen),
            Err(EvalError::Unjudged { problem, .. }) => {
                let name = video.file_name().unwrap_or_default().display();
                problems.push(format!("{name}: {problem}"));
            }
            Err(other) => return Err(other),
        }
    }
    if fingers.is_empty() {
        return Err(unjudged(format!("expected a finger that can be judged, got none: {}", problems.join("; "))));
    }
    Ok(Grasp::new(fingers, problems.len(), contact_by))
}

impl Grasp {
    /// Places the window, by the contact that the detector of this index tells.
    fn new(fingers: Vec<Vec<Vec<Seen>>>, unjudged_count: usize, contact_by: usize) -> Self {
        let from = fingers.iter().filter_map(|finger| after_contact(&finger[contact_by])).min();
        let end = |finger: &Vec<Vec<Seen>>| finger[contact_by].last().map_or(0, |frame| frame.frame + 1);
        let end = fingers.iter().map(end).min().unwrap_or(0);
        let left_count = from.map_or(0, |from| end.saturating_sub(from));
        Grasp { fingers, unjudged_count, from: from.filter(|_| left_count > 0), left_count }
    }
}

/// Number of the first frame after contact for [`CONTACT_NS`]. A frame that cannot be judged tells nothing of it.
fn after_contact(frames: &[Seen]) -> Option<u64> {
    let mut began: Option<&Seen> = None;
    for frame in frames {
        if began.is_some_and(|began| has_lasted(began, frame)) {
            return Some(frame.frame);
        }
        if frame.is_judged {
            began = if frame.touches { began.or(Some(frame)) } else { None };
        }
    }
    None
}

/// Whether a frame comes long enough after another.
fn has_lasted(began: &Seen, now: &Seen) -> bool {
    match began.time_ns.zip(now.time_ns) {
        Some((began_ns, now_ns)) => now_ns.saturating_sub(began_ns) >= CONTACT_NS,
        None => now.frame - began.frame >= CONTACT_FRAMES_COUNT,
    }
}

/// The frames of a finger from a number on, so many numbers long.
fn window(frames: &[Seen], from: u64, count: u64) -> &[Seen] {
    let start = frames.partition_point(|frame| frame.frame < from);
    let end = frames.partition_point(|frame| frame.frame < from + count);
    &frames[start..end]
}

/// Length of the window: the frames left in the shortest clip, among those with contact and a frame after it.
fn window_count<'a>(grasps: impl Iterator<Item = &'a Grasp>) -> u64 {
    grasps.filter(|grasp| grasp.from.is_some()).map(|grasp| grasp.left_count).min().unwrap_or(0)
}

impl Protocol for Wriggles {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn trials_count(&self) -> u64 {
        self.clips.names.len() as u64
    }

    fn trial(&self, number: u64) -> String {
        self.clips.trial(number)
    }

    fn judge(&self, number: u64, detectors: &[&'static Entry]) -> Result<Vec<TrialRecord>, EvalError> {
        let grasps = self.all(number, detectors)?;
        let grasp = match &grasps[number as usize] {
            Ok(grasp) => grasp,
            Err(problem) => return Ok(self.clips.unjudged(number, detectors, problem)),
        };
        let window_count = window_count(grasps.iter().flatten());
        let scale = EvidenceSettings::default();
        let record = |n: usize, entry: &&'static Entry| {
            let of_finger = |finger: &Vec<Vec<Seen>>| {
                let from = grasp.from?;
                let seen = window(&finger[n], from, window_count);
                let (score, first_slide, _) = judged(entry, seen, &scale);
                let first_alarm = seen.iter().find(|frame| frame.alarms).map(|frame| frame.frame);
                Some((score, first_slide, first_alarm))
            };
            let fingers: Vec<_> = grasp.fingers.iter().filter_map(of_finger).collect();
            let score = fingers.iter().map(|finger| finger.0).reduce(f64::max).unwrap_or(0.0);
            let first_alarm_frame = fingers.iter().filter_map(|finger| finger.1).min();
            let record = self
                .clips
                .record(number, entry, score, first_alarm_frame)
                .with("first_state_alarm_frame", fingers.iter().filter_map(|finger| finger.2).min())
                .with("window_frames", window_count)
                .with("window_from_frame", grasp.from);
            match grasp.unjudged_count {
                0 => record,
                count => record.with(UNJUDGED_VIDEOS, count as u64),
            }
        };
        Ok(detectors.iter().enumerate().map(|(n, entry)| record(n, entry)).collect())
    }

    fn tables(&self, records: &[TrialRecord]) -> Vec<Table> {
        let window = records.iter().find_map(|r| r.number_of("window_frames")).unwrap_or(0.0);
        let mut note = format!(
            "Did the object slip out? Highest causal score of both fingers in {window} frames, from 0.5 s of contact on. Alarms: a score over the \
             detector's threshold; ours by its states (incipient or gross) in the last column. Nothing fitted."
        );
        let grasps_with = |has: &dyn Fn(&TrialRecord) -> bool| {
            let mut numbers: Vec<u64> = records.iter().filter(|r| has(r)).map(|r| r.number).collect();
            numbers.dedup();
            numbers.len()
        };
        let windowless = grasps_with(&|r| r.number_of("window_from_frame").is_none() && r.unjudged().is_none());
        if windowless > 0 {
            note +=
                &format!(" Grasps without a frame after 0.5 s of contact, with score 0 and no alarm: {windowless}.");
        }
        let one_finger = grasps_with(&|r| r.number_of(UNJUDGED_VIDEOS).is_some());
        if one_finger > 0 {
            note += &format!(" Grasps with a video that could not be judged, by the other finger alone: {one_finger}.");
        }
        note += &note_of_uncounted(records);
        let mut table = Table::new(
            "Wriggles",
            &note,
            &[
                "detector",
                "grasps",
                "wrong",
                "right %",
                "AUC",
                "alarm on held grasps %",
                "alarm by state on held grasps %",
            ],
        );
        for entry in &DETECTORS {
            let some: Vec<&TrialRecord> =
                records.iter().filter(|r| r.detector == entry.name && r.unjudged().is_none()).collect();
            if some.is_empty() {
                continue;
            }
            let held = || some.iter().filter(|r| r.truth == Some(false));
            let mut cells = row(entry.name, &some);
            cells.push(Cell::Share(share_of(held().map(|r| r.verdict))));
            cells.push(Cell::Share(share_of(held().map(|r| r.number_of("first_state_alarm_frame").is_some()))));
            table.rows.push(cells);
        }
        vec![table]
    }

    fn settings(&self) -> Vec<(String, String)> {
        vec![("data".into(), self.clips.contents.clone()), ("sensor".into(), self.sensor.name.clone())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A finger at 25 Hz: `#` touches, `.` does not, `?` cannot be judged, and of `-` there is no frame.
    fn finger(touches: &str) -> Vec<Vec<Seen>> {
        finger_at(Some(25), touches)
    }

    fn finger_at(rate_hz: Option<u64>, touches: &str) -> Vec<Vec<Seen>> {
        let seen = |(frame, c): (usize, char)| Seen {
            frame: frame as u64,
            time_ns: rate_hz.map(|rate_hz| frame as u64 * 1_000_000_000 / rate_hz),
            is_judged: c != '?',
            touches: c == '#',
            score: 0.0,
            alarms: false,
            evidence: None,
        };
        vec![Vec::new(), touches.chars().enumerate().filter(|(_, c)| *c != '-').map(seen).collect()]
    }

    #[test]
    fn the_window_begins_once_contact_has_lasted() {
        let (released, short, held) = ("#".repeat(12), "#".repeat(12), "#".repeat(20));
        for rate_hz in [Some(25), None] {
            let after = |touches: &str| after_contact(&finger_at(rate_hz, touches)[1]);
            assert_eq!(after(&format!("{released}..{short}.{held}")), Some(27 + 13), "{rate_hz:?}");
            assert_eq!(after(&format!("{released}.{short}")), None, "{rate_hz:?}");
            assert_eq!(after(&format!("{}?{}", "#".repeat(7), "#".repeat(20))), Some(13), "{rate_hz:?}: a torn frame");
            assert_eq!(after(&format!("{}-----{}", "#".repeat(5), "#".repeat(20))), Some(13), "{rate_hz:?}: a gap");
        }
        assert_eq!(after_contact(&finger_at(Some(60), &"#".repeat(60))[1]), Some(30));
        assert_eq!(after_contact(&finger_at(Some(10), &"#".repeat(60))[1]), Some(5));
        assert_eq!(after_contact(&[]), None);
    }

    #[test]
    fn the_window_lies_at_the_same_time_in_both_fingers_whatever_a_recorder_dropped() {
        let [whole, gaps] = [".".repeat(30), format!("..-----{}", ".".repeat(23))].map(|of| finger(&of));
        for finger in [whole, gaps] {
            let frames: Vec<u64> = window(&finger[1], 10, 5).iter().map(|frame| frame.frame).collect();
            assert_eq!(frames, [10, 11, 12, 13, 14]);
        }
    }

    #[test]
    fn every_grasp_is_seen_as_long_as_the_shortest_that_touches() {
        let touched = |left_count: usize| finger(&format!("....{}", "#".repeat(13 + left_count)));
        let grasp = |left_count: usize| Grasp::new(vec![touched(left_count)], 0, 1);
        let bare = || Grasp::new(vec![finger("......")], 0, 1);
        assert_eq!(window_count([grasp(90), bare(), grasp(70)].iter()), 70);
        assert_eq!(window_count([bare()].iter()), 0);
        // A video that ends before the first frame of its window leaves the others theirs.
        let over = Grasp::new(vec![touched(0), finger("....")], 0, 1);
        assert_eq!((over.from, over.left_count), (None, 0));
        assert_eq!(window_count([grasp(90), over, grasp(70)].iter()), 70);
    }
}
