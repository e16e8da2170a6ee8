//! The linker's arguments: cortex-m-rt's script `link.x`, which reads this crate's `memory.x`.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    if variable("CARGO_CFG_TARGET_OS") != "none" || variable("CARGO_CFG_TARGET_ARCH") != "arm" {
        return; // for a PC, the linker needs nothing
    }
    // A `memory.x` in cargo's working folder takes precedence: in Echoloop's workspace its own, in
    // a copy of this crate this one.
    println!("cargo:rustc-link-search={}", variable("CARGO_MANIFEST_DIR"));
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=--nmagic"); // no page alignment: there are no pages
}
