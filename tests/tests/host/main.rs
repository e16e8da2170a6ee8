//! Tests of the host with a sensor in process: front end, scan patterns, closed loop. They are one
//! program, because cargo links each test file with all dependencies. To run one file:
//! `cargo test -p echoloop-tests --test host closed_loop::`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod closed_loop;
mod cloud_files;
mod front;
mod front_end;
mod front_end_physics;
mod scan_patterns;
