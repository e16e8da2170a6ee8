//! See `echoloop_tests::readers::mesh_ply`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    echoloop_tests::readers::mesh_ply(bytes);
});
