//! Boards in QEMU to run the image on, or a loud word on why not.

use std::path::{Path, PathBuf};

use echoloop_sim::qemu::{Machine, QemuOptions, check_installed};

/// The workspace's root.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A machine with the image built for it. Without emulator or image the test is skipped aloud, and
/// fails where `CI` is set.
///
/// # Panics
///
/// In CI, when something is missing.
pub fn machine(machine: Machine) -> Option<QemuOptions> {
    let options = QemuOptions::new(machine, &workspace());
    let missing = match check_installed(machine) {
        Err(error) => error.to_string(),
        Ok(()) if !options.image.is_file() => {
            format!(
                "no image {}: cargo xtask firmware --target {}",
                options.image.display(),
                machine.target()
            )
        }
        Ok(()) => return Some(options),
    };
    echoloop_needs::missing(&format!("{}: {missing}", machine.name()));
    None
}

/// All machines that can be had; see [`machine`].
pub fn machines() -> impl Iterator<Item = QemuOptions> {
    Machine::ALL.into_iter().filter_map(machine)
}
