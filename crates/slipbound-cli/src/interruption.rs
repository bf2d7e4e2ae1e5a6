//! Ctrl-C: the frame at hand is finished, then the command ends.

use crate::outcome::Failure;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that is set when the user presses Ctrl-C. Once a run.
pub fn listen() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = flag.clone();
    ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed))
        .map_err(|e| Failure::work("cannot listen for Ctrl-C", e))?;
    Ok(flag)
}
