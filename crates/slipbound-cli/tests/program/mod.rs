//! The command `slipbound` as a process: arguments and folder in, output and exit code out.
#![allow(dead_code)] // each test uses its part

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

/// The file of the program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_slipbound");

/// The command with these arguments, not started yet.
pub fn command(args: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(args);
    command
}

/// Runs it to its end.
pub fn slipbound(args: &[&str]) -> Output {
    command(args).output().expect("runs")
}

/// The same in a folder.
pub fn slipbound_in(folder: &Path, args: &[&str]) -> Output {
    command(args).current_dir(folder).output().expect("runs")
}

/// Starts it in a folder; its output is piped.
pub fn start_in(folder: &Path, args: &[&str]) -> Child {
    command(args).current_dir(folder).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts")
}

/// Sends a signal, such as `-INT`.
pub fn signal(child: &Child, name: &str) {
    let told = Command::new("kill").args([name, &child.id().to_string()]).status().expect("kill runs");
    assert!(told.success());
}

/// What it printed: standard output, then standard error.
pub fn printed(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// The outcome of the command.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Ended {
    pub fn of(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// Asserts the exit code, and that these words are on standard error.
    #[track_caller]
    pub fn expect(&self, code: i32, said: &[&str]) -> &Self {
        assert_eq!(self.code, Some(code), "{self:?}");
        for words in said {
            assert!(self.err.contains(words), "no `{words}` in {self:?}");
        }
        assert!(!self.err.contains("panicked"), "{self:?}");
        self
    }
}
