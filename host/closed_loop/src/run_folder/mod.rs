//! The folder of a run: its journal, its result and the provenance of both.

pub mod files;
pub mod journal;
pub mod provenance;
pub mod run;
