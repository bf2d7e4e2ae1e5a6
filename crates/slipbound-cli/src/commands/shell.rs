//! `slipbound completions` and `slipbound man`: shell completions and manual pages, generated from the arguments.

use super::inputs;
use crate::outcome::{Failure, Outcome};
use anyhow::anyhow;
use clap::Command;
use clap_complete::Shell;
use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

/// The arguments of `slipbound completions`.
#[derive(Debug, clap::Args)]
pub struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    /// Prints the script that completes the arguments of `program`.
    pub fn run(&self, mut program: Command) -> Result<Outcome, Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut program, "slipbound", &mut script);
        io::stdout().write_all(&script).map_err(|e| match e.kind() {
            io::ErrorKind::BrokenPipe => Failure::ReaderLeft,
            _ => Failure::work("standard output", e),
        })?;
        Ok(Outcome::Done)
    }
}

/// The arguments of `slipbound man`.
#[derive(Debug, clap::Args)]
pub struct Man {
    /// The folder of the pages, made if it is not there: slipbound.1, slipbound-watch.1, ...
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
}

impl Man {
    /// Writes a page for `program` and each of its commands.
    pub fn run(&self, program: Command) -> Result<Outcome, Failure> {
        let shown = self.output.display();
        inputs::refuse_stdout_folder(&self.output)?;
        if self.output.is_file() {
            return Err(Failure::Arguments(anyhow!("{shown}: expected a folder, got a file")));
        }
        let failed = |e: io::Error| Failure::work(format!("{shown}: cannot write"), e);
        fs::create_dir_all(&self.output).map_err(failed)?;
        clap_mangen::generate_to(program, &self.output).map_err(failed)?;
        Ok(Outcome::Done)
    }
}
