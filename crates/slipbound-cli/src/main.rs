//! The command `slipbound`.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(slipbound_cli::run(std::env::args_os()))
}
