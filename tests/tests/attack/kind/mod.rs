//! The kinds of attack: a file each, whose name is what `cargo xtask attack --kind` takes.

mod bytes;
mod journal;
mod readers;
#[cfg(unix)]
mod run_folder;
