//! A line that writes down what it carries.

use std::io;
use std::time::Duration;

use super::Transport;

/// Which way bytes went.
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
    /// What was sent and received, piece by piece. Neighbours went different ways.
    pub fn pieces(&self) -> impl Iterator<Item = (Direction, &[u8])> {
        self.0.iter().map(|(direction, bytes)| (*direction, &bytes[..]))
    }

    /// All bytes that went one way.
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

    /// Says again what the host said, piece by piece, and writes down what the line answers until
    /// it falls quiet: the same conversation, when the sensor is in the state it was in then and
    /// does the same.
    ///
    /// # Errors
    ///
    /// When the line is gone.
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

/// Carries bytes as the line inside does, and writes them down.
pub struct Recording<T> {
    inner: T,
    conversation: Conversation,
}

impl<T> Recording<T> {
    /// Nothing written down yet.
    pub fn new(inner: T) -> Self {
        Self { inner, conversation: Conversation::default() }
    }

    /// What has been carried.
    pub fn conversation(&self) -> &Conversation {
        &self.conversation
    }

    /// The line inside.
    pub fn inner_mut(&mut self) -> &mut T {
        &mut self.inner
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
