//! Ctrl-C, Ctrl-\, SIGTERM, a closed terminal: the present frame is finished, then the command ends.

use crate::outcome::Failure;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that is set when the user or the system requests the end. Once per run.
pub fn listen() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    listen_with(&flag)?;
    Ok(flag)
}

/// The same with a flag that is known before; until this is called a request ends the program at once.
pub fn listen_with(flag: &Arc<AtomicBool>) -> Result<(), Failure> {
    let raised = flag.clone();
    ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed))
        .map_err(|e| Failure::work("cannot listen for Ctrl-C", e))?;
    // Quitting would leave no report and dump a core.
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGQUIT, flag.clone())
        .map_err(|e| Failure::work("cannot listen for SIGQUIT", e))?;
    Ok(())
}
