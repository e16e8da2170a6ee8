//! Boards that the sensor's image runs on in QEMU.

/// Their names; the first is the usual one.
#[cfg(unix)]
pub(super) fn boards() -> Vec<&'static str> {
    crate::boards::qemu::Machine::ALL.map(crate::boards::qemu::Machine::name).to_vec()
}

/// None: QEMU is reached over Unix sockets.
#[cfg(not(unix))]
pub(super) fn boards() -> Vec<&'static str> {
    Vec::new()
}
