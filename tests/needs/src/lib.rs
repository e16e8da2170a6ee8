//! What tests need and a machine may lack: data, an emulator, a browser, a vector unit.
//!
//! A test that cannot ask its question must not look as if it had been answered. [`missing`] says
//! so on the terminal, past the harness, and fails where `CI` is set.

use std::env;
use std::io::Write;
use std::path::PathBuf;

/// Says that the test at hand is left out, and what for.
///
/// # Panics
///
/// Where `CI` is set: what is missing there is a failure.
pub fn missing(what: &str) {
    assert!(env::var_os("CI").is_none(), "missing, and this is CI: {what}");
    say_skipped(what);
}

fn say_skipped(what: &str) {
    // The harness keeps what a passing test prints, but not what it writes.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {what}");
}

/// The folder of the real inputs (docs/data.md), which `ECHOLOOP_DATA` names; without it the test
/// on `what` is left out, see [`missing`].
///
/// # Panics
///
/// In CI without it.
pub fn data_folder(what: &str) -> Option<PathBuf> {
    let folder = env::var_os("ECHOLOOP_DATA").map(PathBuf::from);
    if folder.is_none() {
        missing(&format!("ECHOLOOP_DATA is not set, so {what} was not tried (docs/data.md)"));
    }
    folder
}

/// One of the real inputs, by its path in [`data_folder`].
///
/// # Panics
///
/// In CI without the folder; anywhere, when the folder lacks it.
pub fn data(name: &str) -> Option<PathBuf> {
    let path = data_folder(name)?.join(name);
    assert!(path.exists(), "ECHOLOOP_DATA has no {name}");
    Some(path)
}

/// Whether the processor has AVX2; where it has not, the test is left out, see [`missing`].
///
/// # Panics
///
/// In CI without it.
pub fn avx2(has_avx2: bool) -> bool {
    if !has_avx2 {
        missing("this processor has no AVX2, so what is written for it was not run");
    }
    has_avx2
}

/// Whether the processor has AVX-512; where it has not, says what was not run. That is no failure
/// anywhere, as many processors have none: what is written for it is then not used.
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

    /// Run by [`left_out`] only: alone it would say something that is not so.
    #[test]
    #[ignore = "a part of the tests below"]
    fn a_test_that_lacks_its_data() {
        assert_eq!(data("nothing"), None);
        assert!(!avx2(false));
    }

    /// As above.
    #[test]
    #[ignore = "a part of the tests below"]
    fn a_test_for_avx512() {
        assert!(!avx512(false));
    }

    /// A test above in a process of its own, with `CI` or without.
    fn left_out(test: &str, ci: Option<&str>) -> Output {
        let mut command = Command::new(env::current_exe().expect("this program"));
        command.args(["--exact", "--ignored", test]);
        command.env_remove("ECHOLOOP_DATA").env_remove("CI").envs(ci.map(|value| ("CI", value)));
        command.output().expect("this program runs")
    }

    #[test]
    fn what_is_left_out_is_seen_although_the_test_passes() {
        let output = left_out(DATA, None);
        let seen = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{seen}");
        for word in ["SKIPPED: ECHOLOOP_DATA is not set, so nothing", "SKIPPED: this processor"] {
            assert!(seen.contains(word), "{seen}");
        }
    }

    #[test]
    fn in_ci_it_is_a_failure() {
        let output = left_out(DATA, Some("true"));
        assert!(!output.status.success());
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("missing, and this is CI"), "{said}");
    }

    #[test]
    fn without_avx512_it_is_said_and_no_failure_even_in_ci() {
        let output = left_out("tests::a_test_for_avx512", Some("true"));
        let seen = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{seen}");
        assert!(seen.contains("SKIPPED: this processor has no AVX-512"), "{seen}");
    }
}
