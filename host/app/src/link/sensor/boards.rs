//! Boards that the sensor's image runs on in QEMU.

/// Their names; the first is the usual one.
#[cfg(unix)]
pub(super) fn boards() -> Vec<&'static str> {
    echoloop_sim::qemu::Machine::ALL.map(echoloop_sim::qemu::Machine::name).to_vec()
}

/// None: QEMU is reached over Unix sockets.
#[cfg(not(unix))]
pub(super) fn boards() -> Vec<&'static str> {
    Vec::new()
}
