//! The linker's arguments: the script `link.x` of cortex-m-rt, which reads `memory.x`, or that of
//! riscv-rt after `riscv.x`.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=riscv.x");
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    if variable("CARGO_CFG_TARGET_OS") != "none" {
        return; // a PC links as it always does
    }
    // A `memory.x` in the folder that cargo is started in comes first: in Echoloop's workspace its
    // own, in a copy this one.
    println!("cargo:rustc-link-search={}", variable("CARGO_MANIFEST_DIR"));
    if variable("CARGO_CFG_TARGET_ARCH") == "riscv32" {
        println!("cargo:rustc-link-arg-bins=-Triscv.x");
    }
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=--nmagic"); // no page alignment: there are no pages
}
