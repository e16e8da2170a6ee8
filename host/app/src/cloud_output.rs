//! Where a command writes a cloud, and where it says the rest then.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use clap::builder::TypedValueParser;
use echoloop_registration::cloud::{CloudFormat, Recorded};

use super::common::Common;
use super::exit::{Failure, print, print_bytes};
use super::method_choice::one_of;
use echoloop_closed_loop::run_folder::files::Output;
use echoloop_files::say;

/// Reads `--format`.
pub(super) fn format_parser() -> impl TypedValueParser<Value = CloudFormat> {
    one_of(CloudFormat::ALL.map(|format| (format.name(), format.summary(), format)))
}

/// A place for a cloud, seen to be free.
pub(super) struct CloudOutput {
    /// None: standard output.
    file: Option<Output>,
    format: CloudFormat,
}

impl CloudOutput {
    /// Sees whether a cloud can be written there, before any work.
    pub(super) fn at(named: &Path, asked: Option<CloudFormat>) -> Result<Self, Failure> {
        let refused = |why: &str| Failure::usage(format!("--output {}: {why}", named.display()));
        let file = if is_stdout(named) { None } else { Some(Output::at(named)?) };
        let is_stream = file.as_ref().is_none_or(Output::is_stream);
        let format = match (CloudFormat::of(named), asked) {
            (Some(said), Some(asked)) if said != asked => {
                let (said, asked) = (said.name(), asked.name());
                return Err(refused(&format!("the name says {said}, --format says {asked}")));
            }
            (Some(format), _) | (None, Some(format)) => format,
            (None, None) if is_stream => CloudFormat::Ply,
            (None, None) => {
                return Err(refused(
                    "expected a name that ends in .ply or .pcd, or - for standard output",
                ));
            }
        };
        if file.is_none() && std::io::stdout().is_terminal() {
            return Err(refused("standard output is a terminal, and a cloud is no text"));
        }
        Ok(Self { file, format })
    }

    /// Writes a cloud: a file whole or not at all.
    pub(super) fn write(&self, recorded: &Recorded) -> Result<(), Failure> {
        let bytes = self.format.bytes(&recorded.cloud, &recorded.columns);
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

/// Prints what a command tells. Where the cloud goes to standard output, that is said on standard
/// error, and unless it is a document not at all if nothing is to be remarked.
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
