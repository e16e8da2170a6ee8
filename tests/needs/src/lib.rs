//! Requirements of tests that a machine may lack: data, an emulator, a browser, a vector unit.
//!
//! A test that cannot run must not look as if it had passed. [`missing`] prints so on the terminal,
//! past the harness, and fails with `CI` set.

use std::env;
use std::io::Write;
use std::path::PathBuf;

/// Prints that the current test is skipped, and why.
///
/// # Panics
///
/// With `CI` set.
pub fn missing(what: &str) {
    assert!(env::var_os("CI").is_none(), "missing, and this is CI: {what}");
    say_skipped(what);
}

fn say_skipped(what: &str) {
    // The harness captures what a passing test prints, but not what it writes to stderr directly.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {what}");
}

/// Folder of the real data (docs/data.md), from `ECHOLOOP_DATA`; without it the test of `what` is
/// skipped, see [`missing`].
///
/// # Panics
///
/// Without the folder, with `CI` set.
pub fn data_folder(what: &str) -> Option<PathBuf> {
    let folder = env::var_os("ECHOLOOP_DATA").map(PathBuf::from);
    if folder.is_none() {
        missing(&format!("ECHOLOOP_DATA is not set, so {what} was not tried (docs/data.md)"));
    }
    folder
}

/// A file or folder of the real data, by its path in [`data_folder`].
///
/// # Panics
///
/// Without the folder, with `CI` set; when the folder lacks it.
pub fn data(name: &str) -> Option<PathBuf> {
    let path = data_folder(name)?.join(name);
    assert!(path.exists(), "ECHOLOOP_DATA has no {name}");
    Some(path)
}

/// Returns `has_avx2`; without AVX2 the test is skipped, see [`missing`].
///
/// # Panics
///
/// Without AVX2, with `CI` set.
pub fn avx2(has_avx2: bool) -> bool {
    if !has_avx2 {
        missing("this processor has no AVX2, so what is written for it was not run");
    }
    has_avx2
}

/// Returns `has_avx512`; without AVX-512 it prints what was not run. That never fails, since many
/// processors lack AVX-512 and the code for it is then not used.
pub fn avx512(has_avx512: bool) -> bool {
    if !has_avx512 {
        say_skipped("this processor has no AVX-512, so what is written for it was not run");
    }
    has_avx512
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Output};

    use super::*;

    const DATA: &str = "tests::a_test_that_lacks_its_data";

    /// Run by [`left_out`] only, as it reports a test that is not skipped.
    #[test]
    #[ignore = "a part of the tests below"]
    fn a_test_that_lacks_its_data() {
        assert_eq!(data("nothing"), None);
        assert!(!avx2(false));
    }

    /// Run by [`left_out`] only.
    #[test]
    #[ignore = "a part of the tests below"]
    fn a_test_for_avx512() {
        assert!(!avx512(false));
    }

    /// Runs a test above in its own process, with `CI` or without.
    fn left_out(test: &str, ci: Option<&str>) -> Output {
        let mut command = Command::new(env::current_exe().expect("this program"));
        command.args(["--exact", "--ignored", test]);
        command.env_remove("ECHOLOOP_DATA").env_remove("CI").envs(ci.map(|value| ("CI", value)));
        command.output().expect("this program runs")
    }

    #[test]
    fn a_skipped_test_passes_and_prints_what_it_lacks() {
        let output = left_out(DATA, None);
        let seen = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{seen}");
        for word in ["SKIPPED: ECHOLOOP_DATA is not set, so nothing", "SKIPPED: this processor"] {
            assert!(seen.contains(word), "{seen}");
        }
    }

    #[test]
    fn a_skipped_test_fails_in_ci() {
        let output = left_out(DATA, Some("true"));
        assert!(!output.status.success());
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("missing, and this is CI"), "{said}");
    }

    #[test]
    fn lack_of_avx512_is_printed_and_never_fails() {
        let output = left_out("tests::a_test_for_avx512", Some("true"));
        let seen = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{seen}");
        assert!(seen.contains("SKIPPED: this processor has no AVX-512"), "{seen}");
    }
}
