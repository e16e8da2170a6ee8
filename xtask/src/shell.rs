//! The workspace's root, commands that are run in it, and what a record says of the code.

use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use time::OffsetDateTime;

/// True when a folder of the PATH holds a program.
pub(crate) fn on_path(name: &str) -> bool {
    let Some(path) = env::var_os("PATH") else { return false };
    env::split_paths(&path).any(|folder| folder.join(name).is_file())
}

/// Runs cargo in the workspace's root, and fails when it does.
pub(crate) fn cargo<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Result<()> {
    succeed(cargo_command()?.args(arguments))
}

/// Cargo, in the workspace's root.
pub(crate) fn cargo_command() -> Result<Command> {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(workspace()?);
    Ok(command)
}

/// Builds the release program, which [`echoloop`] runs.
pub(crate) fn build_release() -> Result<()> {
    cargo(["build", "--release", "--package", "echoloop-app", "--bin", "echoloop"])
}

/// The release program, in the workspace's root.
pub(crate) fn echoloop() -> Result<Command> {
    let root = workspace()?;
    let mut command = Command::new(built(&root).join("release/echoloop"));
    command.current_dir(root);
    Ok(command)
}

/// Builds the program as the tests have it. Alone it would be built once more: the features of its
/// packages depend on what else is built.
pub(crate) fn build_as_tested() -> Result<()> {
    cargo(["test", "--workspace", "--no-run", "--quiet"])
}

/// Prints a command and runs it.
pub(crate) fn succeed(command: &mut Command) -> Result<()> {
    let shown = format!("{command:?}");
    eprintln!("+ {shown}");
    if !command.status().with_context(|| format!("cannot run {shown}"))?.success() {
        bail!("failed: {shown}");
    }
    Ok(())
}

/// Standard output of a program, run in the workspace's root.
pub(crate) fn output(program: &str, arguments: &[&str]) -> Result<String> {
    output_in(&workspace()?, program, arguments)
}

fn output_in(folder: &Path, program: &str, arguments: &[&str]) -> Result<String> {
    let mut command = Command::new(program);
    let output = command.current_dir(folder).args(arguments).output();
    let output = output.with_context(|| format!("cannot run {program}"))?;
    let why = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "failed: {program} {}: {why}", arguments.join(" "));
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// First line that a program prints.
pub(crate) fn first_line(program: &str, arguments: &[&str]) -> Result<String> {
    Ok(output(program, arguments)?.lines().next().unwrap_or_default().to_owned())
}

/// Today's date in UTC, as 2026-11-21.
pub(crate) fn today() -> String {
    OffsetDateTime::now_utc().date().to_string()
}

/// Commit, followed by `-dirty` where a file differs from it. Records and pages do not count, as a
/// study writes them line by line.
pub(crate) fn commit() -> Result<String> {
    commit_of(&workspace()?)
}

fn commit_of(root: &Path) -> Result<String> {
    let commit = output_in(root, "git", &["rev-parse", "--short", "HEAD"])?;
    let counted = [".", ":(exclude)benches/record", ":(exclude)docs"];
    let status = ["status", "--porcelain", "--untracked-files=no", "--"];
    let changed = output_in(root, "git", &[&status[..], &counted].concat())?;
    Ok(commit.trim().to_owned() + if changed.is_empty() { "" } else { "-dirty" })
}

/// Folder of builds.
pub(crate) fn built(root: &Path) -> PathBuf {
    root.join(env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// The workspace's root.
pub(crate) fn workspace() -> Result<PathBuf> {
    Ok(Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .context("xtask lies in the workspace")?
        .to_owned())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_commit_is_dirty_when_code_differs_and_not_when_a_record_or_a_page_grows() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let git = |arguments: &[&str]| output_in(root, "git", arguments).unwrap();
        let files = ["src/a.rs", "benches/record/study.jsonl", "docs/data.md"];
        for file in files {
            fs::create_dir_all(root.join(file).parent().unwrap()).unwrap();
            fs::write(root.join(file), "1\n").unwrap();
        }
        git(&["init", "--quiet"]);
        git(&["add", "."]);
        let own = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"];
        git(&[&own[..], &["commit", "--quiet", "--message", "a"]].concat());
        let clean = commit_of(root).unwrap();
        assert!(clean.len() >= 7 && clean.chars().all(|c| c.is_ascii_hexdigit()), "{clean}");
        for file in &files[1..] {
            fs::write(root.join(file), "1\n2\n").unwrap();
            assert_eq!(commit_of(root).unwrap(), clean, "{file}");
        }
        fs::write(root.join("new"), "what git does not know").unwrap();
        assert_eq!(commit_of(root).unwrap(), clean);
        fs::write(root.join(files[0]), "2\n").unwrap();
        assert_eq!(commit_of(root).unwrap(), clean + "-dirty");
    }
}
