//! `--output` of a cloud: a file, or standard output with all text on standard error.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::builder::TypedValueParser;
use echoloop_clouds::{CloudFormat, Recorded};

use super::common::Common;
use super::exit::{Failure, print, print_bytes};
use super::method_choice::one_of;
use echoloop_closed_loop::run_folder::files::Output;
use echoloop_files::say;

/// Reads `--format`.
pub(super) fn format_parser() -> impl TypedValueParser<Value = CloudFormat> {
    one_of(CloudFormat::ALL.map(|format| (format.name(), format.summary(), format)))
}

/// Outputs for a flag's help: `FILE.ply, FILE.pcd, or - for standard output`.
pub(super) fn outputs() -> String {
    let files = CloudFormat::ALL.map(|format| format!("FILE.{}", format.name()));
    format!("{}, or - for standard output", files.join(", "))
}

/// Endings besides `.ply`, for a flag's help.
pub(super) fn other_endings() -> String {
    let others = CloudFormat::ALL.into_iter().filter(|format| *format != CloudFormat::Ply);
    others.map(|format| format!(".{}", format.name())).collect::<Vec<_>>().join(" or ")
}

/// A file or standard output, checked to take a cloud.
pub(super) struct CloudOutput {
    /// None: standard output.
    file: Option<Output>,
    format: CloudFormat,
}

impl CloudOutput {
    /// Checks that a cloud can be written there, before any work.
    pub(super) fn at(named: &Path, format: Option<CloudFormat>) -> Result<Self, Failure> {
        let refused = |why: &str| Failure::usage(format!("--output {}: {why}", named.display()));
        let file = if is_stdout(named) { None } else { Some(Output::at(named)?) };
        let is_stream = file.as_ref().is_none_or(Output::is_stream);
        let format = match (CloudFormat::of(named), format) {
            (Some(name), Some(flag)) if name != flag => {
                let (name, flag) = (name.name(), flag.name());
                return Err(refused(&format!("the name says {name}, --format says {flag}")));
            }
            (Some(format), _) | (None, Some(format)) => format,
            (None, None) if is_stream => CloudFormat::Ply,
            (None, None) => {
                let endings = CloudFormat::ALL.map(|format| format!(".{}", format.name()));
                return Err(refused(&format!(
                    "expected a name that ends in {}, or - for standard output",
                    endings.join(" or ")
                )));
            }
        };
        if file.is_none() && std::io::stdout().is_terminal() {
            return Err(refused("standard output is a terminal, and a cloud is no text"));
        }
        Ok(Self { file, format })
    }

    /// Writes a cloud; a file whole or not at all.
    pub(super) fn write(&self, recorded: &Recorded) -> Result<(), Failure> {
        let bytes = self.format.recorded(recorded);
        match &self.file {
            Some(file) => Ok(file.write(&bytes)?),
            None => print_bytes(&bytes),
        }
    }
}

/// The line that names the file written; a document has none.
pub(super) fn wrote(common: &Common, output: &Option<PathBuf>) -> String {
    let named = output.iter().filter(|path| !common.json && !is_stdout(path));
    named.map(|path| format!("wrote {}\n", path.display())).collect()
}

fn is_stdout(named: &Path) -> bool {
    ["-", "/dev/stdout"].iter().any(|name| named == Path::new(name))
}

/// Prints the text of a command; to standard error where the cloud goes to standard output, and
/// there with `--quiet` only a document.
pub(super) fn tell(
    output: Option<&CloudOutput>,
    common: &Common,
    text: &str,
) -> Result<(), Failure> {
    match output {
        Some(CloudOutput { file: None, .. }) => {
            if common.json || !common.quiet {
                say(text.trim_end());
            }
            Ok(())
        }
        _ => print(text),
    }
}
