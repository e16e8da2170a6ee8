//! Targets of images.

use std::path::{Path, PathBuf};

/// A target of the compiler, or a processor that extends one and has no target of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Target {
    /// Name for `--target`.
    pub(crate) name: &'static str,
    /// Triple of the compiler.
    pub(crate) triple: &'static str,
    /// Processor, where the triple alone does not name it.
    pub(crate) processor: Option<&'static str>,
}

impl Target {
    const fn of_compiler(triple: &'static str) -> Self {
        Self { name: triple, triple, processor: None }
    }

    /// Arguments of the compiler.
    pub(crate) fn flags(&self) -> Vec<String> {
        let mut flags: Vec<String> =
            self.processor.iter().map(|processor| format!("-Ctarget-cpu={processor}")).collect();
        if self.triple.starts_with("riscv") {
            // The bound on the stack is read from them.
            flags.push("-Cforce-unwind-tables=yes".into());
        }
        flags
    }

    /// Folder of its builds, below the workspace's root. Other arguments in the same folder would
    /// build everything anew each time.
    pub(crate) fn folder(&self) -> PathBuf {
        Path::new("target/firmware").join(self.processor.unwrap_or_default())
    }
}

/// Cortex-M4F and M7.
pub(crate) const ARMV7EM: Target = Target::of_compiler("thumbv7em-none-eabihf");
/// Cortex-M33.
pub(crate) const ARMV8M: Target = Target::of_compiler("thumbv8m.main-none-eabihf");
/// Cortex-M55: Armv8.1-M with the vector extension. Its core library is that of Armv8-M.
pub(crate) const CORTEX_M55: Target =
    Target { name: "cortex-m55", triple: ARMV8M.triple, processor: Some("cortex-m55") };
/// RISC-V of 32 bits.
pub(crate) const RV32: Target = Target::of_compiler("riscv32imac-unknown-none-elf");
/// Cortex-M0.
pub(crate) const ARMV6M: Target = Target::of_compiler("thumbv6m-none-eabi");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_processor_without_a_target_of_its_own_is_named_to_the_compiler_and_built_apart() {
        assert_eq!(CORTEX_M55.flags(), ["-Ctarget-cpu=cortex-m55"]);
        assert_eq!(CORTEX_M55.folder(), Path::new("target/firmware/cortex-m55"));
        assert!(ARMV8M.flags().is_empty());
        assert_eq!(ARMV8M.folder(), Path::new("target/firmware/"));
    }
}
