//! See `echoloop_tests::harness::frame_decoder`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| echoloop_tests::harness::frame_decoder(bytes));
