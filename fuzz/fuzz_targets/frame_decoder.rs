//! See `echoloop_tests::harness::frame_decoder`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::harness::frame_decoder);
