//! How a run with hardware ended: the state at the end and the score in, lines, page and exit code out.

use crate::commands::recording::LiveCamera;
use crate::outcome::{Failure, Outcome};
use crate::run_output::{FrameTally, RunOutput, RunScorer};
use crate::terminal;
use anyhow::anyhow;
use slipbound::task::{Ending, Missing, Phase};
use slipbound_rig::link::now_ns;
use slipbound_rig::run::{Row, duration};

/// The state when the loop ended.
pub struct Ended<'a> {
    /// What the run is called.
    pub name: &'a str,
    /// Whether the object was only to be held: then the end of the source is an end of the work.
    pub is_hold: bool,
    /// The source of every finger, as it was named.
    pub sources: &'a [String],
    /// The force, N per finger.
    pub held_n: Option<f64>,
    /// The blind force that the loop was left with, if so, N per finger.
    pub left_with_n: Option<f64>,
    /// Whether the gripper reports that it holds.
    pub holds: bool,
    /// What the task waited for.
    pub missing: Option<Missing>,
    /// The number of frames in which the rest frame is searched.
    pub window_count: u32,
    /// Whether every frame arrived whole and in the size of the first.
    pub is_whole: bool,
}

impl Ended<'_> {
    /// Prints the results, writes the page, and decides whether the work was done. `ran`: what ended the loop.
    pub fn report(self, ran: anyhow::Result<()>, output: RunOutput, scorer: RunScorer) -> Result<Outcome, Failure> {
        let RunScorer { mut score, phase, refused_lowering, tallies, .. } = scorer;
        score.most_n = score.most_n.max(self.left_with_n.unwrap_or(0.0));
        let is_at_work = ran.is_ok() && self.is_hold && matches!(phase, Some(Phase::Working | Phase::Waiting));
        if is_at_work && self.holds {
            score.ending = Some(Ending::Held); // to the end of the source
        }
        let ending = score.ending;
        let unfinished = || match &ran {
            Ok(()) => "not before the end of the source".into(),
            Err(e) => terminal::in_words(e),
        };
        let (lasted, until) = duration(score.ended_s, score.time_s, ending);
        let row = |name: &str, value: String| Row { name: name.into(), value, ..Row::default() };
        let rows = [
            row("ended", ending.map_or_else(unfinished, |ending| ending.name().into())),
            row(&format!("time {until}"), lasted),
            row("alarms", score.alarms_count.to_string()),
            row("largest force commanded", format!("{:.1} N", score.most_n)),
            row("grip at the end", self.held_n.map_or("unknown".into(), |n| format!("{n:.1} N per finger"))),
        ];
        let outcome = output.finish(&rows, ending, |page| format!("report: {page}"))?;
        ran?;
        match ending {
            None if phase.is_none() => Err(self.unjudged(&tallies)),
            None if phase == Some(Phase::Grasping) => {
                Err(Failure::never_began(self.missing, refused_lowering.as_deref()))
            }
            None if is_at_work => Err(anyhow!("at the end of the source {}", Missing::Hold.in_words()).into()),
            None => {
                let (name, was) = (self.name, if phase == Some(Phase::Waiting) { "waiting" } else { "working" });
                Err(anyhow!("the source ended before the task did: {name} was still {was}, its end was not seen")
                    .into())
            }
            Some(ending) if !ending.is_success() => Err(Failure::ended(ending, refused_lowering.as_deref())),
            Some(_) => Ok(if self.is_whole { outcome } else { Outcome::DataLost }),
        }
    }

    /// The failure of a run without a rest frame, before any command.
    fn unjudged(&self, tallies: &[FrameTally]) -> Failure {
        let got = |(number, source): (usize, &String)| {
            format!("{} frames of {source}", tallies.get(number).map_or(0, |tally| tally.whole_count))
        };
        let got: Vec<String> = self.sources.iter().enumerate().map(got).collect();
        let expected = format!("expected {} bright frames of the open hand to begin with", self.window_count);
        anyhow!("{expected}, got {}", got.join(" and ")).into()
    }
}

/// Notes the frames of every finger; returns whether all arrived whole and in the size of the first.
pub fn note_frames(
    names: &[String],
    tallies: &[FrameTally],
    cameras: &[(String, LiveCamera)],
    output: &mut RunOutput,
) -> bool {
    let mut is_whole = true;
    for (number, name) in names.iter().enumerate() {
        let FrameTally { whole_count, torn_count, other_size_count, .. } =
            tallies.get(number).copied().unwrap_or_default();
        let camera = cameras.iter().find(|(of, _)| of == name).map(|(_, live)| live);
        // A torn frame that was replaced by a newer one is lost all the same.
        let torn_count = camera.map_or(torn_count, |live| live.tally.counts().torn_count);
        let mut line = match camera {
            Some(live) => format!("{name}: camera: {}", live.line()),
            None => format!("{name}: {whole_count} frames, {torn_count} torn"),
        };
        if other_size_count > 0 {
            line = format!("{line}, {other_size_count} of another size than the first");
        }
        output.note(now_ns(), &line);
        is_whole &= torn_count + other_size_count == 0;
    }
    is_whole
}
