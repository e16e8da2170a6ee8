//! Python environments with exactly the required packages.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::shell::{on_path, succeed};

/// Python of an environment with exactly these packages, which is made where there is none and when
/// they change.
pub(crate) fn environment(folder: &Path, requirements: &Path) -> Result<PathBuf> {
    let python = interpreter(folder);
    if holds(folder, requirements)? {
        return Ok(python);
    }
    let outer = ["python3", "python"].into_iter().find(|name| on_path(name));
    let Some(outer) = outer else {
        bail!("there is no python3 on the PATH, which runs what is in Python")
    };
    succeed(Command::new(outer).args(["-m", "venv"]).arg(folder))?;
    succeed(
        Command::new(&python)
            .args(["-m", "pip", "install", "--quiet", "--requirement"])
            .arg(requirements),
    )?;
    let installed = installed(folder);
    std::fs::copy(requirements, &installed)
        .with_context(|| format!("cannot write {}", installed.display()))?;
    Ok(python)
}

/// True when an environment holds exactly these packages.
pub(super) fn holds(folder: &Path, requirements: &Path) -> Result<bool> {
    let wanted = std::fs::read(requirements)
        .with_context(|| format!("cannot read {}", requirements.display()))?;
    Ok(std::fs::read(installed(folder)).is_ok_and(|found| found == wanted))
}

/// List of the packages installed in an environment.
fn installed(folder: &Path) -> PathBuf {
    folder.join("requirements.txt")
}

fn interpreter(folder: &Path) -> PathBuf {
    folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::workspace;

    #[test]
    fn an_environment_holds_what_was_asked_only_if_just_that_was_installed() {
        let scripts = workspace().unwrap().join("benches/peers");
        let requirements = scripts.join("requirements.txt");
        assert!(holds(&scripts, &requirements).unwrap(), "it lists the same");
        assert!(!holds(&scripts, &scripts.join("requirements-waveforms.txt")).unwrap());
        assert!(!holds(&scripts.join("absent"), &requirements).unwrap());
        assert!(holds(&scripts, &scripts.join("absent")).is_err(), "nothing is asked for");
    }
}
