//! The `echoloop` command.

use std::process::ExitCode;

use echoloop_host::cli::{Cli, report_failure};

/// What a shell says of a command that wrote to a closed pipe: 128 + SIGPIPE.
const READER_GONE: i32 = 141;

/// `echoloop config | head -1` ends quietly, as other commands do: printing to a closed pipe panics in Rust.
fn end_with_the_reader() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let is_pipe = |text: &str| text.starts_with("failed printing to stdout: Broken pipe");
        if panic.payload_as_str().is_some_and(is_pipe) {
            std::process::exit(READER_GONE);
        }
        usual(panic);
    }));
}

fn main() -> ExitCode {
    end_with_the_reader();
    match Cli::from_command_line().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report_failure(&failure),
    }
}
