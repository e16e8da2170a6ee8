//! See `echoloop_tests::harness::waveforms`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::harness::waveforms);
