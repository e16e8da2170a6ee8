//! Runs the examples and checks their output.

use std::process::Command;

/// Output of an example without arguments. `cargo test -p echoloop-examples` has just built it.
fn run(name: &str) -> String {
    let test = std::env::current_exe().expect("a path");
    let built = test.ancestors().nth(2).expect("target/debug").join("examples").join(name);
    let output = Command::new(&built).output();
    let output = output.unwrap_or_else(|error| panic!("{}: {error}", built.display()));
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Numbers before a word.
fn before(text: &str, word: &str) -> Vec<f64> {
    let numbers = text.split(word).filter_map(|part| part.split_whitespace().last());
    numbers.filter_map(|number| number.parse().ok()).collect()
}

#[test]
fn own_method_finds_the_motion_and_icp_finishes_it() {
    let errors_m = before(&run("own_method"), " m and ");
    assert!(errors_m.len() == 2 && errors_m.iter().all(|m| *m < 0.1), "{errors_m:?}");
    assert!(errors_m[1] < 0.02, "{errors_m:?}");
}

#[test]
fn two_clouds_are_registered() {
    let text = run("register_two_clouds");
    let rms_m = before(&text, " m rms");
    assert!(rms_m.first().is_some_and(|m| *m < 0.1), "{text}");
    assert!(text.contains("target_from_source"), "{text}");
}

#[test]
fn own_objective_is_minimised() {
    let text = run("own_objective");
    assert!(text.contains("[0.7500") && text.contains("Target"), "{text}");
}

#[test]
fn find_echoes_finds_all_three_where_they_are() {
    let text = run("find_echoes");
    let ranges_m = before(&text, " m ±");
    for expected_m in [12.5, 14.2, 60.0] {
        assert!(ranges_m.iter().any(|m| (m - expected_m).abs() < 0.05), "{expected_m}: {text}");
    }
    assert_eq!(ranges_m.len(), 3, "{text}");
}
