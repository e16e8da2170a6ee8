//! See `echoloop_tests::readers::obj`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::readers::obj);
