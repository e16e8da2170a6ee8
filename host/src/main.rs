//! The `echoloop` command.

use std::process::ExitCode;

use echoloop_host::cli::{Cli, report_failure};

fn main() -> ExitCode {
    match Cli::from_command_line().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report_failure(&failure),
    }
}
