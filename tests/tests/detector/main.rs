//! Tests of the detector on a PC: bit-true models, physics, random instruments. They are one
//! program, because cargo links each test file with all dependencies. To run one file:
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
mod recordings;
mod split;
mod strongest;
mod vector_equals_scalar;
