//! Tests of the sensor and its link: messages, faults, power cuts, clocks, waveforms over the link.
//! They are one program, because cargo links each test file with all dependencies. To run one file:
//! `cargo test -p echoloop-tests --test link store::`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod aim;
mod any_bytes;
mod in_time;
mod link_faults;
mod link_fuzz;
mod recording;
mod settings_rollback;
mod store;
mod waveforms_over_link;
mod wire;
