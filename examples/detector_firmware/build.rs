//! The linker's arguments: the script `link.x` of cortex-m-rt, which reads `memory.x`, or that of
//! riscv-rt after `riscv.x`.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=riscv.x");
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    if variable("CARGO_CFG_TARGET_OS") != "none" {
        return; // for a PC, the linker needs nothing
    }
    // A `memory.x` in cargo's working folder takes precedence: in Echoloop's workspace its own, in
    // a copy of this crate this one.
    println!("cargo:rustc-link-search={}", variable("CARGO_MANIFEST_DIR"));
    if variable("CARGO_CFG_TARGET_ARCH") == "riscv32" {
        println!("cargo:rustc-link-arg-bins=-Triscv.x");
    }
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=--nmagic"); // no page alignment: there are no pages
}
