//! What a person should be told of a run beyond its cycles: faults, driver events, what the gripper refused.

use slipbound::control::{CycleView, Fault};
use slipbound::monitor::RestKind;
use slipbound::port::Next;

/// A finger without a frame for longer is told of, ns.
pub const MAX_SILENCE_NS: u64 = 300_000_000;

/// Folds what an observer is shown into lines, each told once.
#[derive(Debug, Default)]
pub struct RunNotes {
    /// Faults told since all was well.
    faults: Vec<Fault>,
    is_lowering_told: bool,
    /// Fingers of which it was told that they start in contact.
    in_contact: Vec<String>,
    /// When each finger last had a frame, ns, and whether its silence was told.
    heard: Vec<(u64, bool)>,
}

impl RunNotes {
    /// The lines of a cycle, in the order in which they are to be read; mostly none.
    pub fn see(&mut self, view: &CycleView<'_>) -> Vec<String> {
        let mut lines: Vec<String> = view.driver_events.iter().map(|event| format!("gripper: {event}")).collect();
        match view.fault {
            Some(fault) if !self.faults.iter().any(|told| told.is_like(fault)) => {
                self.faults.push(fault.clone());
                lines.push(format!("{fault}; the wrist pauses, the grip stays"));
            }
            Some(_) => {}
            None if !self.faults.is_empty() => {
                self.faults.clear();
                lines.push("gripper and wrist are back; going on".into());
            }
            None => {}
        }
        if let (Some(why), false) = (view.refused_lowering, self.is_lowering_told) {
            self.is_lowering_told = true;
            lines.push(why.to_owned());
        }
        self.heard.resize(view.fingers.len(), (view.now_ns, false));
        for (finger, (heard_ns, is_told)) in view.fingers.iter().zip(&mut self.heard) {
            let silent_ns = view.now_ns.saturating_sub(*heard_ns);
            match finger.next {
                Next::Frame | Next::Torn { .. } => {
                    if std::mem::take(is_told) {
                        lines.push(format!("{}: frames again after {:.1} s", finger.name, silent_ns as f64 * 1e-9));
                    }
                    *heard_ns = view.now_ns;
                }
                Next::Silent if silent_ns > MAX_SILENCE_NS && !*is_told => {
                    *is_told = true;
                    lines.push(format!("{}: no frame for {:.1} s", finger.name, MAX_SILENCE_NS as f64 * 1e-9));
                }
                Next::Silent | Next::End => {}
            }
        }
        for finger in view.fingers {
            let starts_in_contact = finger.rest_kind == Some(RestKind::InContact);
            if starts_in_contact && !self.in_contact.iter().any(|told| told == finger.name) {
                self.in_contact.push(finger.name.to_owned());
                lines.push(format!(
                    "{}: starts in contact: displacement counts from the first stationary frames, not from the unloaded gel",
                    finger.name
                ));
            }
        }
        lines
    }
}
