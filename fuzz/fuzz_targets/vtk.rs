//! See `echoloop_tests::readers::vtk`.
#![cfg_attr(fuzzing, no_main)]

echoloop_fuzz::target!(echoloop_tests::readers::vtk);
