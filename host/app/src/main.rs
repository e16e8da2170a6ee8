//! The `echoloop` command.

use std::process::ExitCode;

use echoloop_app::{Cli, READER_GONE, report_failure};
use echoloop_files::say;

/// Ends a `println!` that cannot write, which panics: quietly to a closed pipe, as of
/// `echoloop config | head -1`, else with an error, as on a full disk.
fn end_with_the_output() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        match panic
            .payload_as_str()
            .and_then(|text| text.strip_prefix("failed printing to stdout: "))
        {
            Some(error) if error.starts_with("Broken pipe") => {
                std::process::exit(READER_GONE.into())
            }
            Some(error) => {
                say(format_args!("error: cannot write to standard output: {error}"));
                std::process::exit(1);
            }
            None => usual(panic),
        }
    }));
}

fn main() -> ExitCode {
    end_with_the_output();
    match Cli::from_command_line().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report_failure(&failure),
    }
}
