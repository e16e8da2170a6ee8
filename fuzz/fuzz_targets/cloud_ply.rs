//! See `echoloop_tests::readers::cloud_ply`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::readers::cloud_ply);
