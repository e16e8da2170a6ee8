//! `cargo xtask fuzz`: cargo-fuzz on the stable toolchain.

use std::env;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use crate::shell::workspace;

/// Targets in `fuzz/fuzz_targets`, and the greatest length of an input worth trying, bytes.
const TARGETS: [(&str, u32); 19] = [
    ("frame_decoder", 2_048),
    ("session", 1_024),
    ("store", 513),
    ("waveforms", 1_024),
    ("obj", 2_048),
    ("mesh_ply", 2_048),
    ("roads", 2_048),
    ("gltf", 4_096),
    ("stl", 2_048),
    ("semantic", 2_048),
    ("cloud_ply", 2_048),
    ("pcd", 2_048),
    ("vtk", 1_024),
    ("kitti", 256),
    ("xyz", 1_024),
    ("rows", 2_048),
    ("pose", 1_024),
    ("configuration", 2_048),
    ("journal", 8_192),
];

/// Runs every target, or only one, for a time each, from the kept inputs: lines of hexadecimal
/// digits in `fuzz/corpus/TARGET.hex`. All inputs lie in `target/fuzz/corpus`.
pub(crate) fn run(only: Option<&str>, seconds: u32) -> Result<()> {
    if !is_installed() {
        bail!(
            "cargo-fuzz is not installed; run: cargo install cargo-fuzz (it needs a C++ compiler)"
        );
    }
    let names = TARGETS.map(|(name, _)| name);
    if let Some(unknown) = only.filter(|only| !names.contains(only)) {
        bail!("there is no fuzz target {unknown}; there are {}", names.join(", "));
    }
    for (target, length) in
        TARGETS.into_iter().filter(|(name, _)| only.is_none_or(|only| only == *name))
    {
        let inputs = workspace()?.join("target/fuzz/corpus").join(target);
        unpack(target, &inputs).with_context(|| format!("cannot fill {}", inputs.display()))?;
        let mut command = cargo_fuzz()?;
        command.args(["run", "--sanitizer", "none", "--target-dir", "target/fuzz", target]);
        command.arg(&inputs);
        command.args([
            "--",
            &format!("-max_total_time={seconds}"),
            &format!("-max_len={length}"),
            "-print_final_stats=1",
        ]);
        eprintln!("+ {command:?}");
        if !command.status().context("cannot run cargo fuzz")?.success() {
            bail!("{target} failed; its input lies in fuzz/artifacts/{target}");
        }
    }
    Ok(())
}

fn unpack(target: &str, inputs: &Path) -> Result<()> {
    fs::create_dir_all(inputs)?;
    let kept =
        fs::read_to_string(workspace()?.join("fuzz/corpus").join(target).with_extension("hex"))?;
    for (number, line) in kept.lines().enumerate() {
        let digits = line.as_bytes().chunks(2).map(str::from_utf8);
        let bytes: Vec<u8> =
            digits.map(|pair| Ok(u8::from_str_radix(pair?, 16)?)).collect::<Result<_>>()?;
        fs::write(inputs.join(format!("kept-{number}")), bytes)?;
    }
    Ok(())
}

fn is_installed() -> bool {
    let asked = cargo_fuzz()
        .map(|mut c| c.arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status());
    matches!(asked, Ok(Ok(status)) if status.success())
}

/// Coverage and its counters are unstable flags of the compiler; no sanitizer is needed where
/// nothing is unsafe.
fn cargo_fuzz() -> Result<Command> {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(workspace()?).env("RUSTC_BOOTSTRAP", "1").arg("fuzz");
    command.env("CARGO_PROFILE_RELEASE_DEBUG", "1"); // lines of a crash
    Ok(command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_has_a_file_a_binary_and_inputs() {
        let fuzz = workspace().unwrap().join("fuzz");
        let manifest = fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
        for (name, _) in TARGETS {
            assert!(manifest.contains(&format!("name = \"{name}\"\n")), "{name}");
            assert!(fuzz.join("fuzz_targets").join(name).with_extension("rs").exists(), "{name}");
            let kept = fs::read_to_string(fuzz.join("corpus").join(name).with_extension("hex"));
            assert!(kept.unwrap().lines().count() > 1, "{name}");
        }
        let files = fs::read_dir(fuzz.join("fuzz_targets")).unwrap().count();
        assert_eq!((files, manifest.matches("[[bin]]").count()), (TARGETS.len(), TARGETS.len()));
    }
}
