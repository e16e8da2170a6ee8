//! Requirements of tests that a machine may lack: data, an emulator, a browser, a vector unit.
//!
//! A test that cannot ask its question must not look as if it had been answered. [`missing`] says
//! so on the terminal, past the harness, and fails where `CI` is set. Data sets are not in the
//! repository, and an image may be left out on purpose: both are skipped by name everywhere.

use std::env;
use std::fs::OpenOptions;
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

/// Says it on the terminal, and in the file that `ECHOLOOP_SKIPPED` names.
fn say_skipped(what: &str) {
    // The harness captures what a passing test prints, but not what it writes to stderr directly.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {what}");
    if let Some(path) = env::var_os("ECHOLOOP_SKIPPED") {
        let file = OpenOptions::new().append(true).create(true).open(path);
        let _ = file.and_then(|mut file| file.write_all(format!("{what}\n").as_bytes()));
    }
}

/// Folder of the real inputs (docs/data.md), which `ECHOLOOP_DATA` names; without it the test on
/// `what` is skipped, in CI too.
pub fn data_folder(what: &str) -> Option<PathBuf> {
    let folder = env::var_os("ECHOLOOP_DATA").map(PathBuf::from);
    if folder.is_none() {
        say_skipped(&format!(
            "{what}: data that is not in the repository; docs/data.md says where to get it, and \
             ECHOLOOP_DATA its folder"
        ));
    }
    folder
}

/// True when the images for a target were left out on purpose, which `cargo xtask test` says by
/// `ECHOLOOP_LEFT_OUT`: then the test is skipped, in CI too.
pub fn is_left_out(target: &str) -> bool {
    let left_out = env::var("ECHOLOOP_LEFT_OUT").unwrap_or_default();
    let is_left_out = left_out.split(',').any(|name| name == target);
    if is_left_out {
        say_skipped(&format!(
            "boards with {target}: no source of their images changed since firmware/verified.toml \
             (cargo xtask test --all)"
        ));
    }
    is_left_out
}

/// One of the real inputs, by its path in [`data_folder`].
///
/// # Panics
///
/// When the folder lacks it.
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
    const AVX2: &str = "tests::a_test_for_avx2";

    /// Run by [`left_out`] only, as it reports a test that is not skipped.
    #[test]
    #[ignore = "a part of the tests below"]
    fn a_test_that_lacks_its_data() {
        assert_eq!(data("nothing"), None);
        assert!(is_left_out("thumb"));
    }

    /// As above.
    #[test]
    #[ignore = "a part of the tests below"]
    fn a_test_for_avx2() {
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
        command.env_remove("ECHOLOOP_SKIPPED").env("ECHOLOOP_LEFT_OUT", "riscv,thumb");
        command.output().expect("this program runs")
    }

    #[test]
    fn what_is_left_out_is_seen_although_the_test_passes() {
        let output = left_out(AVX2, None);
        let seen = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{seen}");
        assert!(seen.contains("SKIPPED: this processor"), "{seen}");
    }

    #[test]
    fn in_ci_it_is_a_failure() {
        let output = left_out(AVX2, Some("true"));
        assert!(!output.status.success());
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("missing, and this is CI"), "{said}");
    }

    #[test]
    fn data_and_images_that_are_left_out_are_skipped_by_name_even_in_ci() {
        for ci in [None, Some("true")] {
            let output = left_out(DATA, ci);
            let seen = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{seen}");
            for word in ["SKIPPED: nothing: data", "docs/data.md", "boards with thumb"] {
                assert!(seen.contains(word), "{seen}");
            }
        }
    }

    #[test]
    fn without_avx512_it_is_said_and_no_failure_even_in_ci() {
        let output = left_out("tests::a_test_for_avx512", Some("true"));
        let seen = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{seen}");
        assert!(seen.contains("SKIPPED: this processor has no AVX-512"), "{seen}");
    }
}
