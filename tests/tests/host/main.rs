//! The host with a sensor in process: front end, scan patterns, the loop. One program, for cargo
//! links each file of its own with everything we have. One file alone:
//! `cargo test -p echoloop-tests --test host closed_loop::`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod closed_loop;
mod cloud_files;
mod front;
mod front_end;
mod front_end_physics;
mod scan_patterns;
