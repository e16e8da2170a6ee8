//! Linker arguments. The part has a script of its own: cortex-m-rt's reads `memory.x`, and the
//! linker would take the one of the folder that cargo is started in, which is the emulated boards'.

use std::env;
use std::path::Path;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=link/nrf52840.x");
    println!("cargo:rerun-if-changed=../image/link/sections.x");
    println!("cargo:rustc-check-cfg=cfg(nrf52840)");
    let variable = |name: &str| env::var(name).unwrap_or_default();
    // A Cortex-M0 or M33 is another part; for it the program only prints how to build the image.
    if variable("TARGET") != "thumbv7em-none-eabihf" {
        return;
    }
    println!("cargo:rustc-cfg=nrf52840");
    let here = variable("CARGO_MANIFEST_DIR");
    let here = Path::new(&here);
    println!("cargo:rustc-link-search={}", here.join("../image/link").display());
    println!("cargo:rustc-link-arg-bins=-T{}", here.join("link/nrf52840.x").display());
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo:rustc-link-arg-bins=--nmagic"); // no page alignment: there are no pages
}
