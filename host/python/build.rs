//! Linker flags of a module whose symbols Python has: macOS wants to be told.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
