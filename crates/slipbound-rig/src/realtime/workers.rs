//! The monitors of a hand's fingers in parallel.

use slipbound::control::ControlError;
use slipbound::finger_pipeline::{FingerPipeline, MonitorJob, MonitorRunner};
use slipbound::port::GripSample;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

/// Runs the monitors of all fingers but the last on threads of their own, and that one on the thread of the loop.
#[derive(Default)]
pub struct MonitorWorkers {
    workers: Vec<MonitorWorker>,
}

impl MonitorWorkers {
    /// Threads are started when fingers are first judged.
    pub fn new() -> Self {
        MonitorWorkers::default()
    }
}

impl MonitorRunner for MonitorWorkers {
    fn judge(&mut self, fingers: &mut [FingerPipeline], grip: Option<GripSample>) -> Result<(), ControlError> {
        let Some((last, others)) = fingers.split_last_mut() else { return Ok(()) };
        self.workers.resize_with(self.workers.len().max(others.len()), MonitorWorker::new);
        let mut broken = None;
        for (finger, worker) in others.iter_mut().zip(&mut self.workers) {
            if let Some(job) = finger.lend(grip)
                && !worker.begin(job)
            {
                broken.get_or_insert_with(|| finger.name().to_owned());
            }
        }
        last.judge(grip);
        for (finger, worker) in others.iter_mut().zip(&mut self.workers) {
            match worker.end() {
                Some(Ok(job)) => finger.take_back(job),
                Some(Err(())) => drop(broken.get_or_insert_with(|| finger.name().to_owned())),
                None => {}
            }
        }
        broken.map_or(Ok(()), |finger| Err(ControlError::Monitor { finger }))
    }
}

/// A thread that owns nothing and is lent a monitor and a frame at a time. It ends when this is dropped.
struct MonitorWorker {
    to: SyncSender<MonitorJob>,
    from: Receiver<MonitorJob>,
    is_lent: bool,
}

impl MonitorWorker {
    fn new() -> Self {
        let (to, lent) = sync_channel::<MonitorJob>(1);
        let (back, from) = sync_channel(1);
        thread::spawn(move || {
            for mut job in lent {
                job.run();
                if back.send(job).is_err() {
                    return;
                }
            }
        });
        MonitorWorker { to, from, is_lent: false }
    }

    /// False when the thread has failed.
    fn begin(&mut self, job: MonitorJob) -> bool {
        self.is_lent = self.to.send(job).is_ok();
        self.is_lent
    }

    /// The lent job, once it is judged; None when nothing was lent, an error when the thread has failed.
    fn end(&mut self) -> Option<Result<MonitorJob, ()>> {
        std::mem::take(&mut self.is_lent).then(|| self.from.recv().map_err(drop))
    }
}
