//! Transport to a sensor in this process.

use std::io;
use std::time::Duration;

use crate::boards::pc::PcSensor;
use echoloop_frontend::FrontEnd;

use super::Transport;

/// Carries bytes to a [`PcSensor`], which answers at once: a timeout never waits.
pub struct InProcess<F>(pub PcSensor<F>);

impl<F: FrontEnd> Transport for InProcess<F> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.send(bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> io::Result<usize> {
        Ok(self.0.receive(buffer))
    }
}
