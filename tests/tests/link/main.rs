//! The sensor and its line: messages, faults, power cuts, clocks, waveforms that travel. One
//! program, for cargo links each file of its own with everything we have. One file alone:
//! `cargo test -p echoloop-tests --test link store::`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod any_bytes;
mod in_time;
mod link_faults;
mod link_fuzz;
mod recording;
mod settings_rollback;
mod store;
mod waveforms_over_link;
mod wire;
