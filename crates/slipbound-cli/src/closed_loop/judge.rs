//! A finger judged beside the others: a thread that owns nothing and is lent a monitor and a frame at a time.

use anyhow::anyhow;
use slipbound::image::ImageError;
use slipbound::monitor::{SlipMonitor, SlipReport};
use slipbound::port::{FrameBuffer, GripSample};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

/// What is lent and given back.
struct Work {
    monitor: Box<SlipMonitor>,
    frame: FrameBuffer,
    grip: Option<GripSample>,
    report: Option<Result<SlipReport, ImageError>>,
}

impl Work {
    fn judge(&mut self) {
        self.report = Some(self.frame.frame().map(|frame| self.monitor.step(&frame, self.grip)));
    }
}

/// The thread; it ends when this is dropped.
pub struct Judge {
    to: SyncSender<Work>,
    from: Receiver<Work>,
}

impl Judge {
    /// Starts it.
    pub fn new() -> Self {
        let (to, lent) = sync_channel::<Work>(1);
        let (back, from) = sync_channel(1);
        thread::spawn(move || {
            for mut work in lent {
                work.judge();
                if back.send(work).is_err() {
                    return;
                }
            }
        });
        Judge { to, from }
    }

    /// Lends it a monitor and a frame; [`Judge::give_back`] must follow.
    pub fn lend(&self, monitor: Box<SlipMonitor>, frame: FrameBuffer, grip: Option<GripSample>) -> anyhow::Result<()> {
        self.to.send(Work { monitor, frame, grip, report: None }).map_err(|_| anyhow!("its judge has broken down"))
    }

    /// What was lent, and the report on the frame.
    pub fn give_back(&self) -> anyhow::Result<(Box<SlipMonitor>, FrameBuffer, SlipReport)> {
        let broken = || anyhow!("its judge has broken down");
        let Work { monitor, frame, report, .. } = self.from.recv().map_err(|_| broken())?;
        Ok((monitor, frame, report.ok_or_else(broken)??))
    }
}
