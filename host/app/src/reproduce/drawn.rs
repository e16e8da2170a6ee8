//! Figures of `echoloop reproduce`.

use std::path::Path;

use super::super::exit::Failure;
use super::overlays::overlays;
use echoloop_closed_loop::run_folder::files::{Output, file_error};
use echoloop_study::{Cells, Figures, Folder, Table, figures};

/// Draws all figures of a table's cells.
pub(super) fn drawn(folder: &Folder, table: &Table) -> Figures {
    let cells = Cells::read(folder, table);
    figures(&cells, &overlays(folder, &cells))
}

/// Refuses a folder that figures cannot be written to, before any work.
///
/// # Errors
///
/// A file in the way, or a folder that takes none.
pub(super) fn check_place(folder: &Path) -> Result<(), Failure> {
    let is_there = |path: &&Path| path.as_os_str().is_empty() || path.symlink_metadata().is_ok();
    let nearest = folder.ancestors().find(is_there).unwrap_or(Path::new(""));
    let nearest = if nearest.as_os_str().is_empty() { Path::new(".") } else { nearest };
    let fail = |kind: std::io::ErrorKind| file_error("write figures in", folder)(kind.into());
    if !nearest.is_dir() {
        return Err(fail(std::io::ErrorKind::NotADirectory).into());
    }
    Output::at(&nearest.join("figure.svg.probe")).map_err(|error| fail(error.source.kind()))?;
    Ok(())
}
