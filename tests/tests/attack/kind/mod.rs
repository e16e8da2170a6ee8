//! Kinds of attack, a file each; `cargo xtask attack --kind` takes the file's name.

mod bytes;
mod journal;
mod readers;
#[cfg(unix)]
mod run_folder;
