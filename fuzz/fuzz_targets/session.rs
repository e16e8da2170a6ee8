//! See `echoloop_tests::harness::session`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::harness::session);
