//! Sets the cfg of the loops that the target has instructions for: `dual_multiply` or `mve`.

use std::env;

/// Processors with MVE, the vector unit for integers.
const WITH_MVE: [&str; 3] = ["cortex-m52", "cortex-m55", "cortex-m85"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(dual_multiply, mve)");
    // Stable Rust hides target_feature = "dsp" and "mve", so the compiler's arguments are read
    // instead.
    let target = env::var("TARGET").unwrap_or_default();
    let arguments = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    let is_armv8_main = target.starts_with("thumbv8m.main");
    // Start-up code for hard floats switches the unit on; without it the unit's first instruction
    // faults.
    let has_mve = target.ends_with("eabihf") && WITH_MVE.contains(&processor(&arguments));
    if is_armv8_main && has_mve && !is_without_mve(&arguments) {
        println!("cargo:rustc-cfg=mve");
    } else if is_armv8_main || target.starts_with("thumbv7em") {
        println!("cargo:rustc-cfg=dual_multiply");
    }
}

/// True for a part that was made without the unit: `-C target-feature=-mve`.
fn is_without_mve(arguments: &str) -> bool {
    let lists =
        arguments.split('\x1f').filter_map(|argument| argument.split_once("target-feature="));
    lists.flat_map(|(_, features)| features.split(',')).any(|feature| feature == "-mve")
}

/// Last `-C target-cpu` among the compiler's arguments; empty without one.
fn processor(arguments: &str) -> &str {
    let mut named =
        arguments.split('\x1f').filter_map(|argument| argument.split_once("target-cpu="));
    named.next_back().map_or("", |(_, processor)| processor)
}
