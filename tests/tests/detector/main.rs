//! The detector, on a PC: its bit-true models, its physics, instruments drawn at random. One
//! program, for cargo links each file of its own with everything we have. One file alone:
//! `cargo test -p echoloop-tests --test detector limits::`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod accuracy;
mod bit_exact;
mod constants;
#[cfg(unix)]
mod detector_firmware;
mod fog;
mod ideal;
mod instruments;
mod limits;
mod near_field;
mod power;
mod split;
mod strongest;
mod vector_equals_scalar;
