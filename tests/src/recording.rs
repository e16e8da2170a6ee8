//! Transport that records its bytes.

use std::io;
use std::time::Duration;

use echoloop_sensors::transport::Transport;

/// Direction of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From host to sensor.
    ToSensor,
    /// From sensor to host.
    ToHost,
}

/// Bytes in the order in which the host sent and received them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Conversation(Vec<(Direction, Vec<u8>)>);

impl Conversation {
    /// Bytes piece by piece; neighbours have different directions.
    pub fn pieces(&self) -> impl Iterator<Item = (Direction, &[u8])> {
        self.0.iter().map(|(direction, bytes)| (*direction, &bytes[..]))
    }

    /// All bytes of one direction.
    pub fn bytes(&self, way: Direction) -> Vec<u8> {
        self.pieces()
            .filter(|(direction, _)| *direction == way)
            .flat_map(|(_, bytes)| bytes)
            .copied()
            .collect()
    }

    fn push(&mut self, way: Direction, bytes: &[u8]) {
        match self.0.last_mut() {
            _ if bytes.is_empty() => {}
            Some((last, piece)) if *last == way => piece.extend(bytes),
            _ => self.0.push((way, bytes.to_vec())),
        }
    }

    /// Sends the host's bytes again, piece by piece, and records the answers until the line is
    /// quiet: the same conversation when the sensor begins in the same state.
    ///
    /// # Errors
    ///
    /// When the line is lost.
    pub fn replay(&self, line: impl Transport, quiet: Duration) -> io::Result<Self> {
        let mut line = Recording::new(line);
        let mut chunk = [0; 1024];
        for (_, bytes) in self.pieces().filter(|(direction, _)| *direction == Direction::ToSensor) {
            line.send(bytes)?;
            while line.receive(&mut chunk, quiet)? > 0 {}
        }
        Ok(line.conversation)
    }
}

/// Transport that records the bytes of the one inside.
pub struct Recording<T> {
    inner: T,
    conversation: Conversation,
}

impl<T> Recording<T> {
    /// Empty recording.
    pub fn new(inner: T) -> Self {
        Self { inner, conversation: Conversation::default() }
    }

    /// Bytes so far.
    pub fn conversation(&self) -> &Conversation {
        &self.conversation
    }
}

impl<T: Transport> Transport for Recording<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.conversation.push(Direction::ToSensor, bytes);
        self.inner.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let length = self.inner.receive(buffer, timeout)?;
        self.conversation.push(Direction::ToHost, &buffer[..length]);
        Ok(length)
    }
}
