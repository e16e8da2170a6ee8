//! A line that loses, changes, repeats and cuts messages: no wrong settings are ever committed, and
//! nothing hangs.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_frontend::SceneResponse;
use echoloop_frontend::{Receiver, Return, WaveformFrontEnd};
use echoloop_link::{Command, Decoder, Greeting, MAX_FRAME, Nack, decode, encode};
use echoloop_sensor::store;
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::{InProcess, Transport};
use echoloop_tests::faults::{Faulty, Rates, Shared};
use echoloop_tests::vectors;
use rand::RngExt;

fn sensor() -> InProcess<WaveformFrontEnd> {
    sensor_with(4, 2)
}

/// A sensor with more beams than a report holds.
fn wide_sensor() -> InProcess<WaveformFrontEnd> {
    sensor_with(8, 8)
}

fn sensor_with(columns: u16, rows: u16) -> InProcess<WaveformFrontEnd> {
    let pattern = ScanPattern::Grid(Grid { columns, rows, ..Grid::default() });
    let scene = Arc::new(SceneResponse::empty(pattern.beams()));
    let front_end = WaveformFrontEnd::new(Receiver::default(), scene, 1);
    InProcess(PcSensor::new(front_end, pattern, Hardware::REFERENCE))
}

const fn tries(tries: u32) -> RetryPolicy {
    RetryPolicy { timeout: Duration::from_secs(1), tries }
}

const ONCE: RetryPolicy = tries(1);

/// Active settings, read without faults.
fn active(client: &mut Client<Faulty<InProcess<WaveformFrontEnd>>>) -> Settings {
    let rates = std::mem::replace(&mut client.transport_mut().rates, Rates::NONE);
    let settings = client.read_settings().unwrap();
    client.transport_mut().rates = rates;
    settings
}

#[test]
fn a_bad_line_never_commits_what_was_not_asked_for() {
    for (rate, retry_policy, at_least) in
        [(0.01, tries(8), 499), (0.05, tries(8), 490), (0.2, tries(8), 300), (0.05, ONCE, 180)]
    {
        let mut rng = vectors::rng(11);
        let line = Faulty::new(sensor(), 12);
        let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
        client.transport_mut().rates = Rates::all(rate);
        let (mut done, mut reported) = (0, 0);
        let mut before = Settings::default();
        for _ in 0..500 {
            let wanted =
                Settings { gain_cdb: rng.random_range(-1_000..=3_000), ..Settings::default() };
            match client.configure(&wanted) {
                Ok(_) => {
                    done += 1;
                    assert_eq!(active(&mut client), wanted, "at rate {rate}");
                    before = wanted;
                }
                Err(ClientError::Silent { .. }) => {
                    reported += 1;
                    // Old or new; the client does not know which, and this test does not tell it.
                    let now = active(&mut client);
                    assert!(now == before || now == wanted, "at rate {rate}: {now:?}");
                    before = now;
                }
                Err(other) => panic!("at rate {rate}: {other}"),
            }
        }
        let harmed = client.transport_mut().harmed;
        println!(
            "rate {rate}, {} tries: {done} done, {reported} reported, {harmed} messages harmed",
            retry_policy.tries
        );
        assert_eq!(done + reported, 500);
        assert!(harmed > 20, "at rate {rate} only {harmed} messages were harmed");
        assert!(done >= at_least, "at rate {rate} {done} of 500 were done");
    }
}

#[test]
fn a_client_that_lost_the_answer_to_its_commit_finds_out_and_goes_on() {
    let line = Faulty::new(sensor(), 1);
    let mut client = Client::connect_from(line, ONCE, 0).unwrap();
    let mut lost = 0;
    for step in 0..200 {
        let wanted = Settings { gain_cdb: step, ..Settings::default() };
        client.transport_mut().rates = Rates::all(0.3);
        lost += usize::from(client.configure(&wanted).is_err());
        client.transport_mut().rates = Rates::all(0.0);
        client.configure(&wanted).unwrap();
        assert_eq!(client.read_settings().unwrap(), wanted);
    }
    assert!(lost > 100, "{lost}");
}

#[test]
fn scans_over_a_bad_line_are_whole_or_reported() {
    let line = Faulty::new(sensor(), 3);
    let mut client = Client::connect_from(line, tries(6), 0).unwrap();
    let expected = client.scan(1).unwrap();
    client.transport_mut().rates = Rates::all(0.1);
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

#[test]
fn a_sensor_stays_usable_after_programs_that_fail_on_a_bad_line() {
    for (rate, at_least) in [(0.01, 390), (0.05, 380), (0.2, 180)] {
        let mut rng = vectors::rng(21);
        let mut line = Faulty::new(sensor(), 22);
        line.rates = Rates::all(rate);
        let line = Shared(Rc::new(RefCell::new(line)));
        let retry_policy = tries(8);
        let mut before = Settings::default();
        let mut done = 0;
        for frame in 0..400 {
            let wanted =
                Settings { gain_cdb: rng.random_range(-1_000..=3_000), ..Settings::default() };
            let sequence = rng.random();
            let configured = Client::connect_from(line.clone(), retry_policy, sequence).and_then(
                |mut client| {
                    if rng.random_bool(0.3) {
                        let _ = client.scan(frame); // may leave a scan open
                    }
                    client.configure(&wanted)
                },
            );
            let rates = std::mem::replace(&mut line.0.borrow_mut().rates, Rates::NONE);
            let mut read =
                || Client::connect_from(line.clone(), retry_policy, rng.random())?.read_settings();
            // Delayed messages arrive during the first.
            let now = read().or_else(|_| read()).unwrap();
            line.0.borrow_mut().rates = rates;
            match configured {
                Ok(_) => {
                    done += 1;
                    assert_eq!(now, wanted, "at rate {rate}, program {frame}");
                }
                Err(ClientError::Silent { .. } | ClientError::Nack(_)) => {
                    assert!(
                        now == before || now == wanted,
                        "at rate {rate}, program {frame}: {now:?}"
                    );
                }
                Err(other) => panic!("at rate {rate}: {other}"),
            }
            before = now;
        }
        println!("rate {rate}: {done} of 400 programs, {} messages harmed", line.0.borrow().harmed);
        assert!(done >= at_least, "at rate {rate} {done} of 400 were done");
    }
}

/// Line that carries a number of answers, then none.
struct Muted<T> {
    inner: T,
    answers_left: usize,
}

impl<T: Transport> Transport for Muted<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let length = self.inner.receive(buffer, timeout)?;
        if length == 0 || self.answers_left == 0 {
            return Ok(0);
        }
        self.answers_left -= 1;
        Ok(length)
    }
}

#[test]
fn an_answer_lost_in_an_open_scan_does_not_lock_the_sensor() {
    for answers in 0..6 {
        let line = Muted { inner: wide_sensor(), answers_left: usize::MAX };
        let mut client = Client::connect_from(line, ONCE, 0).unwrap();
        client.transport_mut().answers_left = 0;
        assert!(matches!(client.scan(1), Err(ClientError::Silent { .. })));
        client.transport_mut().answers_left = answers;
        let _ = client.configure(&Settings { gain_cdb: 1, ..Settings::default() });
        client.transport_mut().answers_left = usize::MAX;
        let wanted = Settings { gain_cdb: 2, ..Settings::default() };
        client.configure(&wanted).unwrap();
        assert_eq!(client.read_settings().unwrap(), wanted, "after {answers} answers");
        assert_eq!(client.scan(2).unwrap().len(), 64);
    }
}

#[test]
fn the_next_program_finds_the_settings_that_a_dead_one_committed() {
    let line = Shared(Rc::new(RefCell::new(wide_sensor())));
    let mut first = Client::connect_from(line.clone(), ONCE, 0).unwrap();
    let left = Settings { gain_cdb: 1, ..Settings::default() };
    // The program dies in the middle of scan 1, having committed during it.
    let half = [
        Command::ReadBeams { frame: 1, first: 0, count: 32 },
        Command::Stage(left),
        Command::Commit {
            hash: echoloop_link::settings_hash(&left),
            base_generation: 0,
            confirm_within: 0,
        },
    ];
    for (sequence, command) in (100..).zip(&half) {
        first
            .transport_mut()
            .send(encode(sequence, command, &mut [0; MAX_FRAME]).unwrap())
            .unwrap();
    }
    while line.clone().receive(&mut [0; 4096], Duration::ZERO).unwrap() > 0 {}
    let mut second = Client::connect_from(line, ONCE, 7_000).unwrap();
    assert_eq!(second.read_settings().unwrap(), left);
    second.configure(&Settings { gain_cdb: 2, ..Settings::default() }).unwrap();
}

/// Line that inserts a frame in front of the n-th message to the sensor.
struct Intruder<T> {
    inner: T,
    sent: usize,
    before: usize,
    first: Vec<u8>,
    /// The frame to insert; `None`: the first message again.
    frame: Option<Vec<u8>>,
}

impl<T> Intruder<T> {
    fn new(inner: T, before: usize, frame: Option<Vec<u8>>) -> Self {
        Self { inner, sent: 0, before, first: Vec::new(), frame }
    }
}

impl<T: Transport> Transport for Intruder<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.sent == 0 {
            self.first = bytes.to_vec();
        }
        if self.sent == self.before {
            self.inner.send(self.frame.as_ref().unwrap_or(&self.first))?;
        }
        self.sent += 1;
        self.inner.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.inner.receive(buffer, timeout)
    }
}

#[test]
fn a_late_hello_does_no_harm() {
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    for before in 1..6 {
        let line = Intruder::new(sensor(), before, None);
        let mut client = Client::connect_from(line, ONCE, 0).unwrap();
        client.configure(&wanted).unwrap();
        assert_eq!(client.read_settings().unwrap(), wanted, "before message {before}");
        assert_eq!(client.read_counters().unwrap().stale, u32::from(before > 1));
    }
}

#[test]
fn a_program_that_counts_from_just_below_another_is_answered() {
    let line = Shared(Rc::new(RefCell::new(sensor())));
    for behind in 0..300 {
        let mut first = Client::connect_from(line.clone(), ONCE, 1_000).unwrap();
        first.read_counters().unwrap();
        let mut second = Client::connect_from(line.clone(), ONCE, 1_003 - behind).unwrap();
        let wanted = Settings { gain_cdb: i32::from(behind), ..Settings::default() };
        second.configure(&wanted).unwrap();
        assert_eq!(second.read_settings().unwrap(), wanted, "{behind} behind");
    }
}

#[test]
fn a_late_hello_and_a_late_forget_do_not_erase_settings_saved_since() {
    let mut client = Client::connect_from(sensor(), ONCE, 0).unwrap(); // hello is number 1
    client.forget().unwrap(); // number 3
    client.save().unwrap();
    for (sequence, command) in [(1, Command::Hello(Greeting::OURS)), (3, Command::Forget)] {
        client
            .transport_mut()
            .send(encode(sequence, &command, &mut [0; MAX_FRAME]).unwrap())
            .unwrap();
    }
    let flash = client.transport_mut().0.store_mut();
    assert!(store::load(flash, &Hardware::REFERENCE).is_some());
    assert_eq!(client.read_counters().unwrap().stale, 2);
}

#[test]
fn a_late_command_of_an_earlier_program_does_not_lock_the_sensor() {
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    for sequence in [300, 1_000, 40_000, 65_535] {
        for before in 1..4 {
            let frame =
                encode(sequence, &Command::ReadCounters, &mut [0; MAX_FRAME]).unwrap().to_vec();
            let line = Intruder::new(sensor(), before, Some(frame));
            let mut client = Client::connect_from(line, ONCE, 0).unwrap();
            client.configure(&wanted).unwrap();
            assert_eq!(
                client.read_settings().unwrap(),
                wanted,
                "{sequence} before message {before}"
            );
            assert_eq!(client.read_counters().unwrap().stale, 1);
        }
    }
}

#[test]
fn a_late_command_numbered_like_ours_locks_the_sensor_until_the_next_hello() {
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    for before in 2..4 {
        let frame = encode(100, &Command::ReadCounters, &mut [0; MAX_FRAME]).unwrap().to_vec();
        let line = Intruder::new(sensor(), before, Some(frame));
        let mut client = Client::connect_from(line, tries(2), 0).unwrap();
        assert!(matches!(client.configure(&wanted), Err(ClientError::Silent { .. })));
        client.configure(&wanted).unwrap();
        assert_eq!(client.read_settings().unwrap(), wanted, "before message {before}");
    }
}

#[test]
fn a_restarted_sensor_is_noticed_and_configured_again() {
    // Past half of all sequence numbers, which a fresh sensor could take for old ones.
    let mut client = Client::connect_from(sensor(), ONCE, 40_000).unwrap();
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    client.configure(&wanted).unwrap();
    *client.transport_mut() = sensor();
    assert!(matches!(client.scan(1), Err(ClientError::Nack(Nack::NotReady))));
    assert_eq!(client.read_settings().unwrap(), Settings::default());
    client.configure(&wanted).unwrap();
    assert_eq!(client.read_settings().unwrap(), wanted);
}

/// Line of endless garbage.
struct Babble;

impl Transport for Babble {
    fn send(&mut self, _bytes: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> io::Result<usize> {
        buffer
            .iter_mut()
            .zip([1, 2, 3, 0].into_iter().cycle())
            .for_each(|(slot, byte)| *slot = byte);
        Ok(buffer.len())
    }
}

#[test]
fn a_line_of_endless_garbage_is_given_up_in_time() {
    let retry_policy = RetryPolicy { timeout: Duration::from_millis(10), tries: 3 };
    let began = Instant::now();
    assert!(matches!(
        Client::connect(Babble, retry_policy),
        Err(ClientError::Silent { tries: 3, .. })
    ));
    assert!(began.elapsed() < Duration::from_secs(5));
}

#[test]
fn programs_start_at_different_sequence_numbers() {
    struct First(Rc<RefCell<Vec<u16>>>);
    impl Transport for First {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            let mut decoder = Decoder::new();
            for &byte in bytes {
                if let Some(Ok(frame)) = decoder.push(byte) {
                    self.0.borrow_mut().push(decode::<Command>(frame).unwrap().0);
                }
            }
            Ok(())
        }

        fn receive(&mut self, _buffer: &mut [u8], _timeout: Duration) -> io::Result<usize> {
            Ok(0)
        }
    }
    let seen = Rc::new(RefCell::new(Vec::new()));
    for _ in 0..8 {
        let retry_policy = RetryPolicy { timeout: Duration::ZERO, tries: 1 };
        assert!(Client::connect(First(Rc::clone(&seen)), retry_policy).is_err());
    }
    seen.borrow_mut().sort_unstable();
    seen.borrow_mut().dedup();
    assert!(seen.borrow().len() > 1, "all of eight programs began at {:?}", seen.borrow());
}

/// Line that damages every 300th byte, either way.
struct Periodic<T> {
    line: T,
    passed: [usize; 2],
    every: usize,
    /// Number of messages sent.
    sent: usize,
}

impl<T> Periodic<T> {
    fn harm(&mut self, way: usize, bytes: &mut [u8]) {
        for byte in bytes {
            self.passed[way] += 1;
            *byte ^= u8::from(self.passed[way].is_multiple_of(self.every)) << 4;
        }
    }
}

impl<T: Transport> Transport for Periodic<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut bytes = bytes.to_vec();
        self.sent += 1;
        self.harm(0, &mut bytes);
        self.line.send(&bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let length = self.line.receive(buffer, timeout)?;
        self.harm(1, &mut buffer[..length]);
        Ok(length)
    }
}

/// A sensor of 64 beams that each see a wall.
fn walls() -> InProcess<WaveformFrontEnd> {
    let pattern = ScanPattern::Grid(Grid { columns: 8, rows: 8, ..Grid::default() });
    let wall = Return { range_m: 20.0, strength_per_m2: 1e-3 };
    let scene = SceneResponse {
        beams: (0..=pattern.beams()).collect(),
        returns: vec![wall; pattern.beams() as usize],
        ..SceneResponse::default()
    };
    let front_end = WaveformFrontEnd::new(Receiver::default(), Arc::new(scene), 1);
    InProcess(PcSensor::new(front_end, pattern, Hardware::REFERENCE))
}

#[test]
fn on_a_line_that_damages_every_300th_byte_a_scan_is_read_in_shorter_reports() {
    // Beams with echoes: reports of 32 are longer than 300 bytes.
    let mut clean = Client::connect_from(walls(), tries(8), 0).unwrap();
    let expected: Vec<_> = (1..4).map(|frame| clean.scan(frame).unwrap()).collect();
    assert!(expected.iter().flatten().all(|echoes| echoes.len() == 1));
    for every in [300, 170] {
        let line = Periodic { line: walls(), passed: [0, 150], every, sent: 0 };
        let policy = RetryPolicy { timeout: Duration::from_millis(5), tries: 8 };
        let mut client = Client::connect_from(line, policy, 0).unwrap();
        client.configure(&Settings::default()).unwrap();
        for (frame, expected) in (1..4).zip(&expected) {
            assert_eq!(&client.scan(frame).unwrap(), expected, "every {every}, scan {frame}");
        }
        // The line has healed: after some scans, two reports of 32 beams are a scan again.
        client.transport_mut().every = usize::MAX;
        (0..60).for_each(|_| drop(client.scan(1)));
        let before = client.transport_mut().sent;
        client.scan(1).unwrap();
        assert_eq!(client.transport_mut().sent - before, 2, "every {every}");
    }
}

#[test]
fn a_restart_and_another_host_are_said() {
    let mut client = Client::connect_from(sensor(), ONCE, 40_000).unwrap();
    *client.transport_mut() = sensor();
    assert!(client.scan(1).unwrap_err().to_string().starts_with("the sensor restarted"));
    // Another host says hello on the same line, and its answers come to us.
    let mut client = Client::connect_from(sensor(), tries(2), 0).unwrap();
    let hello = Command::Hello(Greeting::OURS);
    let theirs = encode(30_000, &hello, &mut [0; MAX_FRAME]).unwrap().to_vec();
    client.transport_mut().send(&theirs).unwrap();
    let said = client.scan(1).unwrap_err().to_string();
    assert!(said.contains("who else is on the line?"), "{said}");
}
