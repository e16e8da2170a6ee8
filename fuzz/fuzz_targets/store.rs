//! See `echoloop_tests::harness::store`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::harness::store);
