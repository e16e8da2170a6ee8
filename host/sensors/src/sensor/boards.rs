//! Names of the boards that QEMU emulates here.

/// Names of the boards, the default first.
#[cfg(unix)]
pub(super) fn boards() -> Vec<&'static str> {
    crate::boards::qemu::Machine::ALL.map(crate::boards::qemu::Machine::name).to_vec()
}

/// None: QEMU is reached over Unix sockets.
#[cfg(not(unix))]
pub(super) fn boards() -> Vec<&'static str> {
    Vec::new()
}
