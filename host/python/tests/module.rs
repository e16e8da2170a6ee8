//! The module is built with the workspace, for Python to load.

use std::{env, fs};

#[test]
fn the_shared_library_has_the_function_that_python_calls() {
    let name = [env::consts::DLL_PREFIX, "_native", env::consts::DLL_SUFFIX].concat();
    let library = env::current_exe().expect("a path").with_file_name(name);
    let bytes = fs::read(&library).expect("a library beside the test");
    let function = b"PyInit__native";
    assert!(bytes.windows(function.len()).any(|part| part == function), "{}", library.display());
}
