//! The command `slipbound` as a function, so that another program can offer it too, such as `python -m slipbound`.

mod args;
mod commands;
mod emulated;
mod help;
mod interruption;
mod loopback;
mod outcome;
mod run_output;
mod set_option;
mod terminal;

use clap::{Command, CommandFactory, FromArgMatches};
use outcome::{Failure, Outcome};
use slipbound_rig::printable::printable;
use std::borrow::Cow;
use std::ffi::OsString;
use std::io::{self, Write};

/// Runs the command given by the arguments, the first of which is the program's name, and returns the exit code: 0
/// done, 1 failed on the way, 2 bad arguments, 3 finished, but frames were torn or of another size, or something could
/// not be written. Help and usage errors are printed like everything else.
pub fn run<T: Into<OsString> + Clone>(args: impl IntoIterator<Item = T>) -> u8 {
    let args = match parsed(args) {
        Ok(args) => args,
        Err(help) => {
            // Our own help has colours; an error message quotes the input.
            let rendered = help.render().to_string();
            let _ = match printable(&rendered) {
                Cow::Borrowed(_) => help.print(),
                Cow::Owned(text) => write!(io::stderr(), "{text}"),
            }; // a closed terminal is not a failure
            return u8::try_from(help.exit_code()).unwrap_or(2);
        }
    };
    match commands::run(&args) {
        Ok(Outcome::Done) | Err(Failure::ReaderLeft) => 0,
        Ok(Outcome::DataLost) => 3,
        Err(Failure::Work(e)) => terminal::complain(&e, 1),
        Err(Failure::Arguments(e)) => terminal::complain(&e, 2),
    }
}

/// Every command with its arguments and its help, as a clap command: the source of completions, manual pages and tests.
pub fn command() -> Command {
    help::with_examples(args::Args::command())
}

fn parsed<T: Into<OsString> + Clone>(args: impl IntoIterator<Item = T>) -> Result<args::Args, clap::Error> {
    let mut command = command();
    let mut matches = command.try_get_matches_from_mut(args)?;
    args::Args::from_arg_matches_mut(&mut matches).map_err(|e| e.format(&mut command))
}
