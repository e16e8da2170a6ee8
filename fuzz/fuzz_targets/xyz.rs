//! See `echoloop_tests::readers::xyz`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::xyz(bytes);
});
