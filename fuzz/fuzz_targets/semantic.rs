//! See `echoloop_tests::readers::semantic`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::semantic(bytes);
});
