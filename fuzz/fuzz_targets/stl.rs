//! See `echoloop_tests::readers::stl`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::stl(bytes);
});
