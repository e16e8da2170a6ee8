//! See `echoloop_tests::harness::session`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| echoloop_tests::harness::session(bytes));
