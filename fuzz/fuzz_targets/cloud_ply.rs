//! See `echoloop_tests::readers::cloud_ply`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::cloud_ply(bytes);
});
