//! See `echoloop_tests::readers::rows`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::readers::rows);
