//! The `echoloop` command.
fn main() {}
