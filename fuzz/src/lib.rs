//! Form of the fuzz targets: libFuzzer's under `cargo xtask fuzz`, a program without it.
//!
//! cargo-fuzz compiles with `--cfg fuzzing`. Without it a target is a program that tries one input,
//! so every build of the workspace compiles and lints the targets, and needs neither libFuzzer nor
//! a C++ compiler: `cargo run -p echoloop-fuzz --bin obj < INPUT`.

#[cfg(fuzzing)]
pub use libfuzzer_sys;

/// Makes a target of a function from bytes.
#[cfg(fuzzing)]
#[macro_export]
macro_rules! target {
    ($function:path) => {
        $crate::libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            $function(bytes);
        });
    };
}

/// Makes a program of a function from bytes, which tries those of its standard input.
#[cfg(not(fuzzing))]
#[macro_export]
macro_rules! target {
    ($function:path) => {
        fn main() -> std::io::Result<()> {
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut std::io::stdin(), &mut bytes)?;
            $function(&bytes);
            Ok(())
        }
    };
}
