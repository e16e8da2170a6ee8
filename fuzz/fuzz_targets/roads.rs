//! See `echoloop_tests::readers::roads`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::readers::roads);
