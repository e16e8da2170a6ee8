//! See `echoloop_tests::readers::gltf`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::gltf(bytes);
});
