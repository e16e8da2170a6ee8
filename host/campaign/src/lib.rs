//! Campaigns: many runs of `echoloop`, one for each cell of a plan.
//!
//! 1. A [`Plan`] is a TOML file: axes, their values, and the configuration that each value sets. A
//!    [`Cell`] has one value of each axis; [`Plan::settings`] are those of its run.
//! 2. [`Unfinished`] runs the cells that have no record, one after the other. So a campaign resumes
//!    where it was left, and a cell that failed is tried again.
//! 3. A record is kept as soon as its cell is done. Tables and pages are written from records.
//!
//! | campaign | plan | a cell is run by | record |
//! |---|---|---|---|
//! | `echoloop reproduce` | `host/study/src/plan.toml` | its `runner.rs` | the user's folder |
//! | `cargo xtask proof` | `benches/plans/proof.toml` | `tune`, `evaluate` | `proof.jsonl` |
//! | `cargo xtask study` | `benches/plans/study.toml` | `tune` | `study.jsonl` |
//! | `cargo xtask study --front` | the same | `tune --pareto energy` | `fronts.jsonl` |
//! | `cargo xtask patterns` | `benches/plans/patterns.toml` | `evaluate` | `patterns.jsonl` |
//!
//! `echoloop reproduce` runs cells in process, where they share traced scans; the others start a
//! process for each, in `xtask/src/program.rs`. The two kinds of record differ because their
//! readers do. A user's folder is of one build and seed, refuses any other, and has all of a run. A
//! [`Line`] of `benches/record` names its commit, so that builds may differ, and has what the page
//! needs.

mod line;
mod plan;
mod unfinished;

pub use line::{Line, append, lines};
pub use plan::{Cell, Choice, Plan};
pub use unfinished::Unfinished;
