//! The folder of a run: its journal, its result and the provenance of both.

pub mod atomic_folder;
pub mod files;
pub mod journal;
pub mod provenance;
pub mod run;
pub mod tuned_run;
