//! A run as it is written down and told.

use crate::closed_loop::{ClosedLoop, Told, Turn, Turned};
use crate::measures::{Measures, truth_of};
use crate::outcome::Failure;
use crate::terminal::Terminal;
use anyhow::anyhow;
use slipbound::grip::GripController;
use slipbound::image::Rgb;
use slipbound::sensor::Sensor;
use slipbound::task::Phase;
use slipbound_lab::hand::HandTruth;
use slipbound_rig::overlay::Overlay;
use slipbound_rig::run::{Cycle, Row, RunFolder, RunInfo};
use std::path::{Path, PathBuf};

/// The run folder, the terminal, and what is summed up.
pub struct Chronicle {
    folder: RunFolder,
    overlays: Vec<Overlay>,
    /// What the run is measured by.
    pub measures: Measures,
    /// Where it is told.
    pub terminal: Terminal,
    last: Option<Cycle>,
    slips_count: u32,
    /// Kinds of trouble told since all was well.
    troubles: Vec<String>,
    is_lowering_told: bool,
}

impl Chronicle {
    /// Begins one in a folder that is new or empty.
    pub fn create(folder: &Path, info: &RunInfo, sensors: &[Sensor]) -> Result<Self, Failure> {
        Ok(Chronicle {
            folder: RunFolder::create(folder, info).map_err(Failure::arguments)?,
            overlays: sensors.iter().map(Overlay::new).collect(),
            measures: Measures::default(),
            terminal: Terminal::with_status(),
            last: None,
            slips_count: 0,
            troubles: Vec::new(),
            is_lowering_told: false,
        })
    }

    /// A turn, and what was true then where that is known.
    pub fn turn(&mut self, around: &ClosedLoop, told: &Told<'_>, truth: Option<&HandTruth>) -> anyhow::Result<()> {
        for note in told.notes {
            self.note(told.now_ns, &format!("gripper: {note}"))?;
        }
        match &around.trouble {
            Some(trouble) => {
                let kind = trouble.kind();
                if !self.troubles.contains(&kind) {
                    self.troubles.push(kind);
                    self.note(told.now_ns, &format!("{}; the wrist pauses, the grip stays", trouble.why))?;
                }
            }
            None if !self.troubles.is_empty() => {
                self.troubles.clear();
                self.note(told.now_ns, "gripper and wrist are back; going on")?;
            }
            None => {}
        }
        if let (Some(why), false) = (&around.refused_lowering, self.is_lowering_told) {
            self.is_lowering_told = true;
            self.note(told.now_ns, &why.clone())?;
        }
        match &told.turned {
            Turned::Commanded(turn) => self.commanded(around, told.now_ns, turn, truth),
            Turned::AtRest | Turned::Waiting | Turned::Over => {
                truth.into_iter().for_each(|truth| self.measures.watch(truth));
                Ok(())
            }
        }
    }

    fn commanded(
        &mut self,
        around: &ClosedLoop,
        now_ns: u64,
        turn: &Turn,
        truth: Option<&HandTruth>,
    ) -> anyhow::Result<()> {
        let grip = around.task.grip();
        self.measures.see(now_ns, turn, grip.alarms_count(), truth);
        let cycle = Cycle {
            time_ns: now_ns,
            hand: turn.hand,
            gripper: turn.gripper,
            wrist: turn.wrist,
            grip_command: turn.step.grip,
            wrist_command: turn.step.wrist,
            phase: turn.step.phase,
            margin: grip.margin(),
            alarms_count: grip.alarms_count(),
            truth: truth.map(truth_of),
            trouble: around.trouble.is_some(),
        };
        self.folder.cycle(&cycle)?;
        self.tell(&cycle)?;
        if self.folder.slips_count() > self.slips_count {
            self.slips_count = self.folder.slips_count();
            for (eye, overlay) in around.eyes.iter().zip(&mut self.overlays) {
                let (Some(monitor), Some(report)) = (eye.monitor(), &eye.report) else { continue };
                overlay.draw(eye.frame.frame().ok().as_ref(), report, monitor);
                let rgb = overlay.rgb();
                let picture = Rgb::new(&rgb, overlay.size())?;
                self.folder.picture(now_ns, &eye.name, &format!("{:.1} N", turn.step.grip.force_n), picture)?;
            }
        }
        self.last = Some(cycle);
        Ok(())
    }

    /// What the task was doing last; None before the first command.
    pub fn phase(&self) -> Option<Phase> {
        self.last.as_ref().map(|cycle| cycle.phase)
    }

    /// Something that no cycle shows.
    pub fn note(&mut self, now_ns: u64, text: &str) -> anyhow::Result<()> {
        self.folder.note(now_ns, text);
        self.say(&format!("{}  {text}", at(now_ns)))
    }

    fn say(&mut self, line: &str) -> anyhow::Result<()> {
        self.terminal.say(line).map_err(|_| anyhow!("cannot write to the terminal"))
    }

    /// A line where something happened, the status otherwise.
    fn tell(&mut self, cycle: &Cycle) -> anyhow::Result<()> {
        let at = at(cycle.time_ns);
        let before = self.last.as_ref();
        let force_n = cycle.gripper.pressed_n().unwrap_or(0.0);
        let mut lines = Vec::new();
        if self.folder.slips_count() > self.slips_count {
            lines.push(format!("{at}  slip {} at {force_n:.0} N", self.folder.slips_count()));
        }
        if before.is_some_and(|last| (last.grip_command.force_n - cycle.grip_command.force_n).abs() >= 4.5) {
            lines.push(format!("{at}  grip to {:.0} N", cycle.grip_command.force_n));
        }
        if let Phase::Ended(ending) = cycle.phase
            && before.is_none_or(|last| last.phase != cycle.phase)
        {
            lines.push(format!("{at}  {}", ending.evidence()));
        }
        for line in lines {
            self.say(&line)?;
        }
        let bar = "#".repeat((force_n / 2.0).round().clamp(0.0, 40.0) as usize);
        let angle_deg = cycle.wrist.angle_rad.to_degrees();
        self.terminal.status(&format!("{at}  {angle_deg:6.1} deg  {force_n:5.1} N {bar}"));
        Ok(())
    }

    /// Says the results, writes the page, answers where it is.
    pub fn finish(mut self, rows: &[Row]) -> Result<(Terminal, PathBuf), Failure> {
        self.terminal.clear_bar();
        for row in rows {
            self.terminal.say(&format!("  {:<28}{:<22}{}", row.name, row.value, row.target))?;
        }
        let page = self.folder.finish(rows, self.measures.ending).map_err(|e| Failure::Work(e.into()))?;
        Ok((self.terminal, page))
    }
}

fn at(now_ns: u64) -> String {
    format!("{:6.2} s", now_ns as f64 * 1e-9)
}
