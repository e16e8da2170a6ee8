//! Transport to a sensor in QEMU.

use std::io;
use std::time::Duration;

use crate::boards::qemu::Qemu;
use echoloop_frontend::FrontEnd;

use super::Transport;

impl<F: FrontEnd> Transport for Qemu<F> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        Qemu::send(self, bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        Qemu::receive(self, buffer, timeout)
    }
}
