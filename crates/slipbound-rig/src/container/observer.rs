//! A control loop's reports and cycles, into its recording.

use super::recorder::Inlet;
use super::tap::ReportLines;
use crate::report_json::{Header, ReportJson, RestOrigin};
use crate::run::FingerInfo;
use slipbound::control::{CycleObserver, CycleView};
use slipbound::finger_pipeline::FingerView;
use slipbound::monitor::Settings;

/// Hands in every report and every cycle. It does not wait for the disk.
pub struct McapObserver {
    inlet: Inlet,
    fingers: Vec<FingerInfo>,
    sources: Vec<String>,
    settings: Settings,
    reports: Vec<Option<ReportJson<ReportLines>>>,
}

impl McapObserver {
    /// For a loop over these fingers, the frames of which are from `sources`.
    pub fn new(inlet: Inlet, fingers: Vec<FingerInfo>, sources: Vec<String>, settings: Settings) -> Self {
        let reports = fingers.iter().map(|_| None).collect();
        McapObserver { inlet, fingers, sources, settings, reports }
    }

    /// The report of a finger, after a header that says what its rest frame was.
    fn report(&mut self, number: usize, finger: &FingerView<'_>) -> Option<()> {
        let (report, kind) = (finger.report?, finger.rest_kind?);
        let lines = self.reports.get_mut(number)?;
        if lines.is_none() {
            let header = Header {
                finger: finger.name,
                sensor: &self.fingers.get(number)?.sensor,
                settings: &self.settings,
                source: self.sources.get(number).map_or("", String::as_str),
                clock: finger.frame.clock,
                rest: RestOrigin { kind: kind.into(), frames: None },
                note: None,
            };
            // Handing in cannot fail: what is lost is counted.
            *lines = ReportJson::new(ReportLines::new(self.inlet.clone(), finger.name, false), &header).ok();
        }
        lines.as_mut()?.frame(report, None).ok()
    }
}

impl CycleObserver for McapObserver {
    fn after_cycle(&mut self, view: &CycleView<'_>) {
        for (number, finger) in view.fingers.iter().enumerate() {
            self.report(number, finger);
        }
        if let Some(json) = view.cycle().and_then(|cycle| serde_json::to_vec(&cycle).ok()) {
            self.inlet.line("/cycle", json);
        }
    }
}
