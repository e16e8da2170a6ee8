//! Boards in QEMU to run the image on, or a loud word on why not.

use std::path::{Path, PathBuf};

use object::{Object, ObjectSymbol};

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
    ready(QemuOptions::new(machine, &workspace()))
}

/// The same with another program that `cargo xtask firmware` builds for its target.
///
/// # Panics
///
/// As [`machine`].
pub fn machine_with(machine: Machine, program: &str) -> Option<QemuOptions> {
    let mut options = QemuOptions::new(machine, &workspace());
    options.image.set_file_name(program);
    ready(options)
}

fn ready(options: QemuOptions) -> Option<QemuOptions> {
    let machine = options.machine;
    if echoloop_needs::is_left_out(machine.target()) {
        return None;
    }
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

/// All machines with a front end that can be had; see [`machine`].
pub fn machines() -> impl Iterator<Item = QemuOptions> {
    Machine::ALL.into_iter().filter(|machine| machine.has_front_end()).filter_map(machine)
}

/// Where an image has a symbol: of this name, or the only one whose mangled name holds it.
///
/// # Panics
///
/// When there is none, or the image is no ELF file.
pub fn symbol(options: &QemuOptions, name: &str) -> u32 {
    let elf = std::fs::read(&options.image).expect("the image");
    let file = object::File::parse(&*elf).expect("an ELF file");
    let found = |matches: &dyn Fn(&str) -> bool| {
        file.symbols().find(|symbol| symbol.name().is_ok_and(matches))
    };
    let symbol = found(&|symbol| symbol == name).or_else(|| found(&|symbol| symbol.contains(name)));
    symbol.unwrap_or_else(|| panic!("no {name}")).address() as u32
}
