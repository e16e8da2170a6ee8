//! See `echoloop_tests::harness::waveforms`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| echoloop_tests::harness::waveforms(bytes));
