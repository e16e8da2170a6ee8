//! The `echoloop` command.

use std::process::ExitCode;

use clap::Parser;
use echoloop_host::cli::{Cli, report_failure};

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report_failure(&failure),
    }
}
