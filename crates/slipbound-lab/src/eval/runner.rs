//! Trials on several cores, handed on in the order of their numbers.

use super::error::{EvalError, SweepError};
use super::protocol::Protocol;
use super::record::TrialRecord;
use crate::rivals::Entry;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

/// Judges the trials of some numbers on at most `jobs_count` threads. `keep` receives the records of one trial after the other,
/// in the order of `numbers`, whichever finishes first.
pub fn run(
    protocol: &dyn Protocol,
    detectors: &[&'static Entry],
    numbers: &[u64],
    jobs_count: usize,
    stop: &(dyn Fn() -> bool + Sync),
    keep: &mut dyn FnMut(Vec<TrialRecord>) -> Result<(), SweepError>,
) -> Result<(), SweepError> {
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs_count.clamp(1, numbers.len().max(1)) {
            let (sender, next, failed) = (sender.clone(), &next, &failed);
            scope.spawn(move || {
                while !stop() && !failed.load(Ordering::Relaxed) {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&number) = numbers.get(place) else { return };
                    let judged = protocol.judge(number, detectors);
                    // A trial that was broken off has not failed.
                    if (judged.is_err() && stop()) || sender.send((place, judged)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let kept = keep_in_order(protocol, numbers, &receiver, keep);
        failed.store(kept.is_err(), Ordering::Relaxed);
        kept
    })
}

fn keep_in_order(
    protocol: &dyn Protocol,
    numbers: &[u64],
    receiver: &mpsc::Receiver<(usize, Result<Vec<TrialRecord>, EvalError>)>,
    keep: &mut dyn FnMut(Vec<TrialRecord>) -> Result<(), SweepError>,
) -> Result<(), SweepError> {
    let (mut waiting, mut due) = (BTreeMap::new(), 0);
    for (place, judged) in receiver {
        waiting.insert(place, judged);
        while let Some(judged) = waiting.remove(&due) {
            let failed = |source| {
                let trial = protocol.trial(numbers[due]);
                SweepError::Trial { protocol: protocol.name(), trial, source }
            };
            keep(judged.map_err(failed)?)?;
            due += 1;
        }
    }
    if due < numbers.len() { Err(SweepError::Interrupted) } else { Ok(()) }
}
