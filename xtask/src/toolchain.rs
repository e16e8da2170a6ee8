//! A toolchain for a microcontroller: the active one with a prebuilt core, or one with core's
//! source.

use std::env;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail};

use crate::target::Target;

/// Cargo and rustc that build for a target, with the core library and linker that they need.
#[derive(Clone, Debug)]
pub(crate) struct Toolchain {
    cargo: PathBuf,
    rustc: PathBuf,
    version: String,
    /// True when core is prebuilt, as with rustup; then clippy is present, too.
    is_prebuilt: bool,
    /// Linker on the PATH; `None`: rustc's own.
    linker: Option<PathBuf>,
}

/// Name of a candidate, its cargo and its rustc.
type Candidate = (&'static str, PathBuf, PathBuf);

impl Toolchain {
    /// The first candidate that can build for a target: `FIRMWARE_CARGO` with `FIRMWARE_RUSTC`, the
    /// active toolchain, Debian's.
    ///
    /// # Errors
    ///
    /// When none can: lists every candidate with its reason, and the commands that help.
    pub(crate) fn find(target: &Target, at_least: (u32, u32)) -> Result<Self> {
        let mut reasons = String::new();
        for (name, cargo, rustc) in candidates() {
            match Self::check(&cargo, &rustc, target.triple, at_least) {
                Ok(toolchain) => return Ok(toolchain),
                Err(reason) => {
                    let _ = write!(reasons, "\n  {name} ({}): {reason}", rustc.display());
                }
            }
        }
        bail!(
            "no toolchain for {}:{reasons}\nEither of these helps:\n  \
             rustup target add {}\n  \
             apt-get install --no-install-recommends rustc-web cargo-web rust-web-src lld",
            target.name,
            target.triple
        )
    }

    fn check(
        cargo: &Path,
        rustc: &Path,
        target: &str,
        at_least: (u32, u32),
    ) -> Result<Self, String> {
        if !cargo.is_file() {
            return Err(format!("there is no {}", cargo.display()));
        }
        let version = query(rustc, &["--version"])?;
        if parse_version(&version).is_none_or(|found| found < at_least) {
            return Err(format!("{version} is older than {}.{}", at_least.0, at_least.1));
        }
        if !query(rustc, &["--print", "target-list"])?.lines().any(|line| line == target) {
            return Err("it does not know the target".into());
        }
        let libraries =
            PathBuf::from(query(rustc, &["--print", "target-libdir", "--target", target])?);
        let sysroot = PathBuf::from(query(rustc, &["--print", "sysroot"])?);
        let source = sysroot.join("lib/rustlib/src/rust/library/core/Cargo.toml");
        let is_prebuilt = holds_core(&libraries);
        if !is_prebuilt && !source.is_file() {
            return Err("it has neither core for the target nor core's source".into());
        }
        let (cargo, rustc) = (cargo.to_owned(), rustc.to_owned());
        Ok(Self { cargo, rustc, version, is_prebuilt, linker: linker(&sysroot)? })
    }

    /// Version of the compiler, as "rustc 1.95.0".
    pub(crate) fn version(&self) -> &str {
        self.version.split(" (").next().unwrap_or(&self.version)
    }

    /// True when core is prebuilt.
    pub(crate) fn is_prebuilt(&self) -> bool {
        self.is_prebuilt
    }

    /// Compiler, cargo, core and linker in one line.
    pub(crate) fn describe(&self) -> String {
        let core = if self.is_prebuilt { "prebuilt core" } else { "core from source" };
        let linker =
            self.linker.as_ref().map_or("bundled rust-lld".into(), |l| l.display().to_string());
        format!("{} ({}), {core}, {linker}", self.version, self.cargo.display())
    }

    /// `cargo` for a target, as this toolchain needs it.
    pub(crate) fn cargo(&self, target: &Target) -> Command {
        let mut command = Command::new(&self.cargo);
        // Variables of an outer cargo's toolchain must not reach this one.
        command.env_remove("RUSTUP_TOOLCHAIN").env_remove("CARGO").env("RUSTC", &self.rustc);
        let mut flags = target.flags();
        if let Some(linker) = &self.linker {
            flags.extend([
                format!("-Clinker={}", linker.display()),
                "-Clinker-flavor=ld.lld".into(),
            ]);
        }
        if !flags.is_empty() {
            command.args(["--config", &format!("target.{}.rustflags={flags:?}", target.triple)]);
        }
        command
    }

    /// Adds the arguments after the subcommand that build core from source: unstable, so only this
    /// command gets `RUSTC_BOOTSTRAP`.
    pub(crate) fn finish<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        if !self.is_prebuilt {
            command.env("RUSTC_BOOTSTRAP", "1").arg("-Zbuild-std=core");
        }
        command
    }
}

fn candidates() -> Vec<Candidate> {
    let mut found = Vec::new();
    if let (Some(cargo), Some(rustc)) =
        (env::var_os("FIRMWARE_CARGO"), env::var_os("FIRMWARE_RUSTC"))
    {
        found.push(("FIRMWARE_CARGO and FIRMWARE_RUSTC", cargo.into(), rustc.into()));
    }
    let active: PathBuf = env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo")).into();
    found.push(("active", active.clone(), active.with_file_name("rustc")));
    found.push(("Debian", "/usr/bin/cargo".into(), "/usr/bin/rustc".into()));
    found
}

fn query(rustc: &Path, arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(rustc)
        .args(arguments)
        .output()
        .map_err(|e| format!("it does not run: {e}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned()),
        false => Err(String::from_utf8_lossy(&output.stderr)
            .lines()
            .next()
            .unwrap_or("it fails")
            .to_owned()),
    }
}

/// "rustc 1.95.0 (…)" → (1, 95).
fn parse_version(text: &str) -> Option<(u32, u32)> {
    let mut numbers = text.split(' ').nth(1)?.split('.');
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

fn holds_core(folder: &Path) -> bool {
    let Ok(entries) = folder.read_dir() else { return false };
    entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("libcore-"))
}

/// Linker on the PATH; `None` where rustc has its own.
fn linker(sysroot: &Path) -> Result<Option<PathBuf>, String> {
    let bundled = sysroot.join("lib/rustlib").read_dir().into_iter().flatten().flatten();
    if bundled.map(|entry| entry.path().join("bin/rust-lld")).any(|path| path.is_file()) {
        return Ok(None);
    }
    let path = env::var_os("PATH").unwrap_or_default();
    let mut found = env::split_paths(&path).flat_map(|f| [f.join("rust-lld"), f.join("ld.lld")]);
    match found.find(|path| path.is_file()) {
        None => Err("it has no linker for it: neither rust-lld nor ld.lld is there".into()),
        found => Ok(found),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::ARMV7EM;

    #[test]
    fn versions_are_compared_as_numbers() {
        assert_eq!(parse_version("rustc 1.95.0 (59807616e 2026-04-14)"), Some((1, 95)));
        assert!(parse_version("rustc 1.100.0").unwrap() > (1, 95));
        assert_eq!(parse_version("error"), None);
    }

    #[test]
    fn an_unsupported_target_is_refused_with_every_reason_and_the_remedies() {
        let target =
            Target { name: "future", triple: "thumbv99-none-eabi", processor: Some("cortex-m99") };
        let error = Toolchain::find(&target, (1, 93)).unwrap_err().to_string();
        assert!(error.contains("active") && error.contains("does not know the target"), "{error}");
        assert!(
            error.contains("Debian") && error.contains("rustup target add thumbv99-none-eabi"),
            "{error}"
        );
    }

    #[test]
    fn a_toolchain_that_is_too_old_is_skipped() {
        let error = Toolchain::find(&ARMV7EM, (99, 0)).unwrap_err().to_string();
        assert!(error.contains("is older than 99.0"), "{error}");
    }
}
