//! See `echoloop_tests::readers::configuration`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::configuration(bytes);
});
