//! See `echoloop_tests::readers::roads`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::roads(bytes);
});
