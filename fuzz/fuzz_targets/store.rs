//! See `echoloop_tests::harness::store`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| echoloop_tests::harness::store(bytes));
