//! `cargo xtask python`: the wheel of the module in `host/python`, or its tests.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::peers::environment::environment;
use crate::shell::{build_as_tested, built, on_path, succeed, workspace};

/// Builds the wheel; with `test`, the module as the tests of the workspace have it, and runs its
/// tests.
///
/// # Errors
///
/// When a tool fails, or a test; without python3 in CI.
pub(crate) fn run(test: bool) -> Result<()> {
    let root = workspace()?;
    if !["python3", "python"].into_iter().any(on_path) {
        return missing();
    }
    if test { tested(&root) } else { wheel(&root).map(drop) }
}

/// Says that the tests are skipped, which is a failure in CI.
fn missing() -> Result<()> {
    let what = "the Python module: there is no python3 on the PATH (apt-get install python3-venv)";
    if env::var_os("CI").is_some() {
        bail!("missing, and this is CI: {what}");
    }
    eprintln!("SKIPPED: {what}");
    Ok(())
}

/// Builds the wheel; its folder.
///
/// # Errors
///
/// When maturin cannot be installed, or fails.
pub(crate) fn wheel(root: &Path) -> Result<PathBuf> {
    let module = module(root);
    let folder = built(root).join("python");
    let wheels = folder.join("wheels");
    let python = environment(&folder.join("maturin"), &module.join("requirements-wheel.txt"))?;
    let mut command = Command::new(python);
    command.args(["-m", "maturin", "build", "--release", "--out"]).arg(&wheels);
    succeed(command.arg("--manifest-path").arg(module.join("Cargo.toml")))?;
    Ok(wheels)
}

fn tested(root: &Path) -> Result<()> {
    build_as_tested()?;
    let (module, folder) = (module(root), built(root).join("python"));
    let python = environment(&folder.join("tests"), &module.join("tests/requirements.txt"))?;
    let site = staged(root, &folder)?;
    let run = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(["-m"]).args(arguments).current_dir(&module);
        command.env("PYTHONPATH", &site).env("MYPYPATH", &site);
        command.env("PYTHONDONTWRITEBYTECODE", "1");
        succeed(command.env("ECHOLOOP_PROGRAM", built(root).join("debug/echoloop")))
    };
    let cache = folder.join("mypy").display().to_string();
    let allowed = ["--allowlist", "tests/stubtest_allow.txt"];
    run(&[&["mypy.stubtest", "echoloop", "--concise"], &allowed[..]].concat())?;
    run(&["mypy", "--cache-dir", &cache])?;
    // Pyright itself, with Node.js in its wheel: that of the name fetches it when it runs.
    let interpreter = python.display().to_string();
    run(&["basedpyright", "--level", "error", "--pythonpath", &interpreter])?;
    run(&["pytest", "--quiet", "-p", "no:cacheprovider"])
}

/// The package beside the module that the tests' profile has built; its folder.
fn staged(root: &Path, folder: &Path) -> Result<PathBuf> {
    let site = folder.join("site");
    let package = site.join("echoloop");
    if package.exists() {
        fs::remove_dir_all(&package).context("cannot empty the package")?;
    }
    fs::create_dir_all(&package)?;
    for entry in fs::read_dir(module(root).join("python/echoloop"))? {
        let entry = entry?.path();
        if let Some(name) = entry.file_name().filter(|_| entry.is_file()) {
            fs::copy(&entry, package.join(name))?;
        }
    }
    let (library, name) = match env::consts::OS {
        "windows" => ("_native.dll", "_native.pyd"),
        "macos" => ("lib_native.dylib", "_native.abi3.so"),
        _ => ("lib_native.so", "_native.abi3.so"),
    };
    let library = built(root).join("debug/deps").join(library);
    fs::copy(&library, package.join(name))
        .with_context(|| format!("cannot copy {}", library.display()))?;
    Ok(site)
}

fn module(root: &Path) -> PathBuf {
    root.join("host/python")
}
