//! A line that damages messages, a line that clients share, and a cheap scene.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use echoloop_frontend::{Analog, FrontEnd, Trigger};
use echoloop_sensors::transport::Transport;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Probability of each fault for each message.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// The message is lost.
    pub drop: f64,
    /// One of its bits is flipped.
    pub flip: f64,
    /// It arrives twice.
    pub duplicate: f64,
    /// It arrives after the next message.
    pub reorder: f64,
    /// Its end is cut off.
    pub truncate: f64,
    /// It arrives after one to [`LATEST`] other messages.
    pub delay: f64,
}

/// Largest number of messages that overtake a delayed one.
pub const LATEST: u64 = 8;

impl Rates {
    /// No faults.
    pub const NONE: Self = Self::all(0.0);

    /// The same probability for each fault.
    pub const fn all(rate: f64) -> Self {
        Self { drop: rate, flip: rate, duplicate: rate, reorder: rate, truncate: rate, delay: rate }
    }
}

/// One direction of a line.
#[derive(Debug, Default)]
struct Way {
    /// Number of messages carried.
    passed: u64,
    /// Delayed messages, each with the value of `passed` at which it is due.
    late: Vec<(u64, Vec<u8>)>,
}

impl Way {
    /// Carries one message; returns the bytes that arrive and the number of faults.
    fn carry(&mut self, message: &[u8], rates: &Rates, rng: &mut ChaCha8Rng) -> (Vec<u8>, usize) {
        let mut bytes = message.to_vec();
        let mut harms = 0;
        let mut happens = |rate: f64, rng: &mut ChaCha8Rng| {
            let so = rate > 0.0 && rng.random_bool(rate);
            harms += usize::from(so);
            so
        };
        self.passed += 1;
        if happens(rates.drop, rng) {
            bytes.clear();
        }
        if happens(rates.flip, rng) && !bytes.is_empty() {
            let at = rng.random_range(0..bytes.len());
            bytes[at] ^= 1 << rng.random_range(0..8);
        }
        if happens(rates.truncate, rng) && !bytes.is_empty() {
            bytes.truncate(rng.random_range(0..bytes.len()));
        }
        if happens(rates.duplicate, rng) {
            bytes.extend_from_within(..);
        }
        let reordered = happens(rates.reorder, rng);
        let delayed = happens(rates.delay, rng);
        if reordered || delayed {
            let by = if delayed { rng.random_range(1..=LATEST) } else { 1 };
            self.late.push((self.passed + by, std::mem::take(&mut bytes)));
        }
        for (_, late) in self.late.extract_if(.., |(due, _)| *due <= self.passed) {
            bytes.extend(late);
        }
        (bytes, harms)
    }
}

/// Numbers of tries of the host's commands, and their duration.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tries {
    /// Number of commands that ended after each number of tries; the first entry is unused.
    pub commands: Vec<u64>,
    /// Longest time until a command was answered or given up.
    pub longest: Duration,
    last: Vec<u8>,
    tries: usize,
    began: Duration,
}

impl Tries {
    /// Notes a frame. The same bytes again are a repetition, as every command has its own number.
    fn sent(&mut self, frame: &[u8], now: Duration) {
        if self.last == frame {
            self.tries += 1;
            return;
        }
        self.end(now);
        self.last = frame.to_vec();
        (self.tries, self.began) = (1, now);
    }

    /// Ends the current command.
    pub fn end(&mut self, now: Duration) {
        if self.tries > 0 {
            self.commands.resize(self.commands.len().max(self.tries + 1), 0);
            self.commands[self.tries] += 1;
            self.longest = self.longest.max(now.saturating_sub(self.began));
        }
        self.tries = 0;
    }
}

/// Speed of the line, bits a second; a byte takes ten bits.
pub const BAUD: u32 = 921_600;

/// Time that some bytes take on the line.
pub fn on_the_line(bytes: usize) -> Duration {
    Duration::from_secs_f64(10.0 * bytes as f64 / f64::from(BAUD))
}

/// Line that damages messages in both directions, each fault at its own rate. The same seed gives
/// the same faults.
///
/// A message is what the host sends at once, or a frame of the sensor's answers.
pub struct Faulty<T> {
    /// The line without faults.
    pub inner: T,
    /// Rates of the faults from now on.
    pub rates: Rates,
    /// Number of faults so far.
    pub harmed: usize,
    /// Number of messages carried: to the sensor, to the host.
    pub carried: [u64; 2],
    /// Tries of the host's commands.
    pub tries: Tries,
    /// Simulated time: bytes at [`BAUD`], and every timeout in full.
    pub now: Duration,
    rng: ChaCha8Rng,
    ways: [Way; 2],
    /// Bytes that have arrived and were not fetched yet.
    out: VecDeque<u8>,
}

impl<T> Faulty<T> {
    /// A line that begins without faults.
    pub fn new(inner: T, seed: u64) -> Self {
        Self {
            inner,
            rates: Rates::NONE,
            harmed: 0,
            carried: [0; 2],
            tries: Tries::default(),
            now: Duration::ZERO,
            rng: crate::vectors::rng(seed),
            ways: Default::default(),
            out: VecDeque::new(),
        }
    }

    fn carry(&mut self, message: &[u8], way: usize) -> Vec<u8> {
        let (bytes, harms) = self.ways[way].carry(message, &self.rates, &mut self.rng);
        self.harmed += harms;
        self.carried[way] += 1;
        bytes
    }
}

impl<T: Transport> Transport for Faulty<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.tries.sent(bytes, self.now);
        self.now += on_the_line(bytes.len());
        let bytes = self.carry(bytes, 0);
        self.inner.send(&bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.out.is_empty() {
            let mut chunk = vec![0; 8192];
            let length = self.inner.receive(&mut chunk, timeout)?;
            self.now += if length == 0 { timeout } else { on_the_line(length) };
            for message in messages(&chunk[..length]) {
                let bytes = self.carry(message, 1);
                self.out.extend(bytes);
            }
        }
        let length = self.out.len().min(buffer.len());
        buffer.iter_mut().zip(self.out.drain(..length)).for_each(|(slot, byte)| *slot = byte);
        Ok(length)
    }
}

/// Line that several clients use in turn.
pub struct Shared<T>(pub Rc<RefCell<T>>);

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0))
    }
}

impl<T: Transport> Transport for Shared<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.borrow_mut().send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.borrow_mut().receive(buffer, timeout)
    }
}

/// Splits bytes into frames, with the zeros at both ends; anything else stays whole.
fn messages(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let end = bytes.windows(2).position(|pair| pair == [0, 0]).map_or(bytes.len(), |at| at + 1);
        let (message, rest) = bytes.split_at(end);
        bytes = rest;
        (!message.is_empty()).then_some(message)
    })
}

/// A cheap front end: every beam has one echo, at a range that depends on the beam. Gains below
/// −9 dB see nothing; other settings change nothing.
#[derive(Clone, Debug, Default)]
pub struct Target {
    /// Number of shots.
    pub shots: u64,
}

impl FrontEnd for Target {
    fn adc_bits(&self) -> u32 {
        12
    }

    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]) {
        self.shots += 1;
        let Trigger { frame, beam, .. } = trigger;
        let noise = |i: usize| ((i * 7_919 + frame as usize * 31 + beam as usize) % 5) as u16;
        codes.iter_mut().enumerate().for_each(|(i, code)| *code = 200 + noise(i));
        if analog.gain_db < -9.0 {
            return;
        }
        let half = analog.pulse_width_ns / analog.sample_period_ns;
        let middle = 100.0 + 10.0 * f64::from(beam % 16);
        for (i, code) in codes.iter_mut().enumerate().skip(80).take(200) {
            let x = (i as f64 - middle) / half;
            if x.abs() < 1.0 {
                *code += (1_000.0 * (1.0 - x.abs())) as u16;
            }
        }
    }
}
