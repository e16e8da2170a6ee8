//! Boards in QEMU with their firmware images; a test without them is skipped with a message.

use std::fs;
use std::path::{Path, PathBuf};

use echoloop_sensors::boards::qemu::{Machine, QemuOptions, check_installed};
use object::{Object, ObjectSymbol};

use crate::gdb::Gdb;

/// The workspace's root.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A machine with its image. Without emulator or image the test is skipped with a message; with
/// `CI` set it fails.
///
/// # Panics
///
/// With `CI` set, when emulator or image are missing.
pub fn machine(machine: Machine) -> Option<QemuOptions> {
    ready(QemuOptions::new(machine, &workspace()))
}

/// As [`machine`], with another program that `cargo xtask firmware` builds.
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

/// All available machines with a front end; see [`machine`].
pub fn machines() -> impl Iterator<Item = QemuOptions> {
    Machine::ALL.into_iter().filter(|machine| machine.has_front_end()).filter_map(machine)
}

/// Address of an image's symbol: the one of this name, or the first whose mangled name contains it.
///
/// # Panics
///
/// When the image has no such symbol, or is no ELF file.
pub fn symbol(options: &QemuOptions, name: &str) -> u32 {
    let elf = fs::read(&options.image).expect("the image");
    let file = object::File::parse(&*elf).expect("an ELF file");
    let found = |matches: &dyn Fn(&str) -> bool| {
        file.symbols().find(|symbol| symbol.name().is_ok_and(matches))
    };
    let symbol = found(&|symbol| symbol == name).or_else(|| found(&|symbol| symbol.contains(name)));
    symbol.unwrap_or_else(|| panic!("no {name}")).address() as u32
}

/// Value of memory that the stack has not reached.
const PAINT: u8 = 0xA5;

/// Paints the `size` bytes below the stack's top on a board that waits for a debugger, and lets the
/// board run.
///
/// # Panics
///
/// When the emulator refuses.
pub fn paint_stack(options: &QemuOptions, socket: &Path, size: u32) {
    let mut gdb = Gdb::connect(socket).expect("a debugger");
    gdb.fill(symbol(options, "_stack_start") - size, size as usize, PAINT).expect("painted memory");
    gdb.detach().expect("a running board");
}

/// Asserts that the stack stayed within the bound recorded beside the image, and used more than
/// half of it. `size` is that of [`paint_stack`].
///
/// # Panics
///
/// When it did not, or the emulator refuses.
pub fn assert_stack_bound(options: &QemuOptions, socket: &Path, size: u32) {
    let bottom = symbol(options, "_stack_start") - size;
    let mut gdb = Gdb::connect(socket).expect("a debugger");
    let memory = gdb.read(bottom, size as usize).expect("memory");
    let unused = memory.iter().position(|&byte| byte != PAINT).expect("a used stack");
    let used = memory.len() - unused;
    let record = fs::read_to_string(options.image.with_extension("stack")).expect("a bound");
    let bound: usize = record.trim().parse().expect("a number");
    println!("{}: {used} bytes of stack used, bound {bound}", options.machine.name());
    assert!(used <= bound, "{used} bytes were used, the bound is {bound}");
    assert!(2 * used > bound, "a bound of {bound} for {used} bytes bounds little");
}
