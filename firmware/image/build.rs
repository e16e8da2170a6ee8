//! Chooses board and linker script by the target, and by the processor where a target has several.
//!
//! The linker looks for `memory.x` first in the folder that it is started in. Cargo starts it in
//! the workspace's root, so the `memory.x` there, the reference board's, always wins. Boards with
//! another memory map have a whole script under another name, which includes no `memory.x`.

use std::env;
use std::path::Path;

/// Boards, and the targets built for each.
const BOARDS: [(&str, &[&str]); 4] = [
    (
        "mps2",
        &[
            "thumbv6m-none-eabi",
            "thumbv7m-none-eabi",
            "thumbv7em-none-eabi",
            "thumbv7em-none-eabihf",
        ],
    ),
    ("an505", &["thumbv8m.main-none-eabi", "thumbv8m.main-none-eabihf"]),
    ("an547", &[CORTEX_M55]),
    ("virt", &["riscv32imac-unknown-none-elf", "riscv32imc-unknown-none-elf"]),
];

/// Stands for `thumbv8m.main-none-eabihf` with `-C target-cpu=cortex-m55`: the compiler has no
/// target for Armv8.1-M.
const CORTEX_M55: &str = "cortex-m55";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=link");
    println!("cargo:rustc-check-cfg=cfg(board, values(\"mps2\", \"an505\", \"an547\", \"virt\"))");
    let variable = |name: &str| env::var(name).unwrap_or_default();
    if variable("CARGO_CFG_TARGET_OS") != "none" {
        return; // on a PC the program only prints how to build the image
    }
    let arguments = variable("CARGO_ENCODED_RUSTFLAGS");
    let is_cortex_m55 = arguments.split('\x1f').any(|a| a.ends_with("target-cpu=cortex-m55"));
    let target = if is_cortex_m55 { CORTEX_M55.to_owned() } else { variable("TARGET") };
    let Some((board, _)) = BOARDS.iter().find(|(_, targets)| targets.contains(&target.as_str()))
    else {
        println!(
            "cargo::error=no board of this image runs {target}; there are boards for {BOARDS:?}"
        );
        return;
    };
    println!("cargo:rustc-cfg=board=\"{board}\"");
    let here = variable("CARGO_MANIFEST_DIR");
    let here = Path::new(&here);
    let scripts: &[&str] = match *board {
        "mps2" => {
            println!("cargo:rustc-link-search={}", here.join("../..").display());
            println!("cargo:rerun-if-changed=../../memory.x");
            &["link.x"]
        }
        "an505" | "an547" => {
            println!("cargo:rustc-link-search={}", here.join("link").display());
            if *board == "an505" { &["link/an505.x"] } else { &["link/an547.x"] }
        }
        _ => &["link/virt.x", "link.x"],
    };
    for script in scripts.iter().chain(&["defmt.x"]) {
        let own = here.join(script);
        let script = if own.exists() { own.display().to_string() } else { (*script).to_owned() };
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
    println!("cargo:rustc-link-arg-bins=--nmagic"); // no page alignment: there are no pages
}
