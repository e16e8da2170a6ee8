//! Says whether the target has the DSP extension's dual multiplications.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(dual_multiply)");
    // Stable hides target_feature = "dsp", so the target's name has to say it.
    let target = env::var("TARGET").unwrap_or_default();
    if target.starts_with("thumbv7em") || target.starts_with("thumbv8m.main") {
        println!("cargo:rustc-cfg=dual_multiply");
    }
}
