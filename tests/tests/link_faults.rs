//! A line that loses, changes, repeats and cuts what it carries: nothing wrong is ever committed, and nothing hangs.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::io;
use std::sync::Arc;
use std::time::Duration;

use echoloop_dsp::{Hardware, ScanPattern, Settings};
use echoloop_host::client::{Client, ClientError, Patience};
use echoloop_host::frontend::{Receiver, WaveformFrontEnd};
use echoloop_host::transport::{InProcess, Transport};
use echoloop_sim::board::PcSensor;
use echoloop_sim::scanner::SceneResponse;
use echoloop_tests::vectors;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Does each of five harms to a message, either way, with one probability.
struct Faulty<T> {
    inner: T,
    rng: ChaCha8Rng,
    rate: f64,
    /// What was held back, to come after the next: to the sensor, to the host.
    late: [Vec<u8>; 2],
    harmed: usize,
}

impl<T> Faulty<T> {
    fn harm(&mut self, bytes: &[u8], way: usize) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        for harm in 0..5 {
            if bytes.is_empty() || !self.rng.random_bool(self.rate) {
                continue;
            }
            self.harmed += 1;
            match harm {
                0 => bytes.clear(),
                1 => {
                    let at = self.rng.random_range(0..bytes.len());
                    bytes[at] ^= 1 << self.rng.random_range(0..8);
                }
                2 => bytes.extend(bytes.clone()),
                3 => bytes.truncate(self.rng.random_range(0..bytes.len())),
                _ => return std::mem::replace(&mut self.late[way], bytes),
            }
        }
        bytes.extend(std::mem::take(&mut self.late[way]));
        bytes
    }
}

impl<T: Transport> Transport for Faulty<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let bytes = self.harm(bytes, 0);
        self.inner.send(&bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut whole = vec![0; buffer.len() / 4];
        let length = self.inner.receive(&mut whole, timeout)?;
        let bytes = self.harm(&whole[..length], 1);
        let length = bytes.len().min(buffer.len());
        buffer[..length].copy_from_slice(&bytes[..length]);
        Ok(length)
    }
}

fn sensor() -> InProcess<WaveformFrontEnd> {
    let scene = SceneResponse { beams: vec![0; 9], returns: Vec::new() };
    let front_end = WaveformFrontEnd::new(Receiver::default(), Arc::new(scene), 1);
    let pattern = ScanPattern { columns: 4, rows: 2, ..ScanPattern::default() };
    InProcess(PcSensor::new(front_end, pattern, Hardware::REFERENCE))
}

/// A harmless reader's view of what is active, past the faults.
fn active(client: &mut Client<Faulty<InProcess<WaveformFrontEnd>>>) -> Settings {
    let rate = std::mem::replace(&mut client.transport_mut().rate, 0.0);
    let settings = client.read_settings().unwrap();
    client.transport_mut().rate = rate;
    settings
}

#[test]
fn a_bad_line_never_commits_what_was_not_asked_for() {
    for (rate, patience, at_least) in [(0.01, 8, 499), (0.05, 8, 490), (0.2, 8, 300), (0.05, 1, 200)] {
        let mut rng = vectors::rng(11);
        let line = Faulty { inner: sensor(), rng: vectors::rng(12), rate: 0.0, late: Default::default(), harmed: 0 };
        let patience = Patience { timeout: Duration::from_millis(1), tries: patience };
        let mut client = Client::connect(line, patience).unwrap();
        client.transport_mut().rate = rate;
        let (mut done, mut reported) = (0, 0);
        let mut before = Settings::default();
        for _ in 0..500 {
            let wanted = Settings { gain_cdb: rng.random_range(-1_000..=3_000), ..Settings::default() };
            match client.configure(&wanted) {
                Ok(_) => {
                    done += 1;
                    assert_eq!(active(&mut client), wanted, "at rate {rate}");
                    before = wanted;
                }
                Err(ClientError::Silent { .. }) => {
                    reported += 1;
                    // Old or new; the client was left unsure, and this test looks without its knowing better.
                    let now = active(&mut client);
                    assert!(now == before || now == wanted, "at rate {rate}: {now:?}");
                    before = now;
                }
                Err(other) => panic!("at rate {rate}: {other}"),
            }
        }
        let harmed = client.transport_mut().harmed;
        assert_eq!(done + reported, 500);
        assert!(harmed > 20, "at rate {rate} only {harmed} messages were harmed");
        assert!(done >= at_least, "at rate {rate} {done} of 500 were done");
    }
}

#[test]
fn a_client_that_lost_the_answer_to_its_commit_finds_out_and_goes_on() {
    let line = Faulty { inner: sensor(), rng: vectors::rng(1), rate: 0.0, late: Default::default(), harmed: 0 };
    let patience = Patience { timeout: Duration::from_millis(1), tries: 1 };
    let mut client = Client::connect(line, patience).unwrap();
    let mut lost = 0;
    for step in 0..200 {
        let wanted = Settings { gain_cdb: step, ..Settings::default() };
        client.transport_mut().rate = 0.3;
        lost += usize::from(client.configure(&wanted).is_err());
        client.transport_mut().rate = 0.0;
        client.configure(&wanted).unwrap();
        assert_eq!(client.read_settings().unwrap(), wanted);
    }
    assert!(lost > 100, "{lost}");
}

#[test]
fn scans_over_a_bad_line_are_whole_or_reported() {
    let line = Faulty { inner: sensor(), rng: vectors::rng(3), rate: 0.0, late: Default::default(), harmed: 0 };
    let patience = Patience { timeout: Duration::from_millis(1), tries: 6 };
    let mut client = Client::connect(line, patience).unwrap();
    let expected = client.scan(1).unwrap();
    client.transport_mut().rate = 0.1;
    let mut whole = 0;
    for _ in 0..300 {
        match client.scan(1) {
            Ok(scan) => {
                whole += 1;
                assert_eq!(scan, expected);
            }
            Err(ClientError::Silent { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }
    assert!(whole > 200, "{whole}");
}
