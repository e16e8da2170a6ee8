//! A line that loses, changes, repeats and cuts what it carries: nothing wrong is ever committed,
//! and nothing hangs.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use echoloop_dsp::{Grid, Hardware, ScanPattern, Settings};
use echoloop_frontend::SceneResponse;
use echoloop_frontend::{Receiver, WaveformFrontEnd};
use echoloop_link::{Command, Decoder, Greeting, MAX_FRAME, Nack, decode, encode};
use echoloop_sensor::store;
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::{InProcess, Transport};
use echoloop_tests::faults::{Faulty, Rates};
use echoloop_tests::vectors;
use rand::RngExt;

fn sensor() -> InProcess<WaveformFrontEnd> {
    let scene = SceneResponse { beams: vec![0; 9], returns: Vec::new() };
    let front_end = WaveformFrontEnd::new(Receiver::default(), Arc::new(scene), 1);
    let pattern = ScanPattern::Grid(Grid { columns: 4, rows: 2, ..Grid::default() });
    InProcess(PcSensor::new(front_end, pattern, Hardware::REFERENCE))
}

/// A harmless reader's view of what is active, past the faults.
fn active(client: &mut Client<Faulty<InProcess<WaveformFrontEnd>>>) -> Settings {
    let rates = std::mem::replace(&mut client.transport_mut().rates, Rates::NONE);
    let settings = client.read_settings().unwrap();
    client.transport_mut().rates = rates;
    settings
}

#[test]
fn a_bad_line_never_commits_what_was_not_asked_for() {
    for (rate, retry_policy, at_least) in
        [(0.01, 8, 499), (0.05, 8, 490), (0.2, 8, 300), (0.05, 1, 180)]
    {
        let mut rng = vectors::rng(11);
        let line = Faulty::new(sensor(), 12);
        let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: retry_policy };
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
                    // Old or new; the client was left unsure, and this test looks without its
                    // knowing better.
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
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
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
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 6 };
    let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
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

/// A line that several clients use, one after the other.
struct Shared<T>(Rc<RefCell<T>>);

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

#[test]
fn programs_that_start_and_fail_on_a_bad_line_leave_no_sensor_behind_that_the_next_cannot_use() {
    for (rate, at_least) in [(0.01, 390), (0.05, 380), (0.2, 180)] {
        let mut rng = vectors::rng(21);
        let mut line = Faulty::new(sensor(), 22);
        line.rates = Rates::all(rate);
        let line = Shared(Rc::new(RefCell::new(line)));
        let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 8 };
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
            // what was held back comes during the first
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

/// Carries answers until a given number have passed, then none.
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
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    for answers in 0..6 {
        let line = Muted { inner: wide_sensor(), answers_left: usize::MAX };
        let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
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
fn a_commit_that_a_dead_program_left_pending_is_what_the_next_one_finds() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let line =
        Shared(Rc::new(RefCell::new(Muted { inner: wide_sensor(), answers_left: usize::MAX })));
    let mut first = Client::connect_from(line.clone(), retry_policy, 0).unwrap();
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
    let mut second = Client::connect_from(line, retry_policy, 7_000).unwrap();
    assert_eq!(second.read_settings().unwrap(), left);
    second.configure(&Settings { gain_cdb: 2, ..Settings::default() }).unwrap();
}

fn wide_sensor() -> InProcess<WaveformFrontEnd> {
    let scene = SceneResponse { beams: vec![0; 65], returns: Vec::new() };
    let front_end = WaveformFrontEnd::new(Receiver::default(), Arc::new(scene), 1);
    let pattern = ScanPattern::Grid(Grid { columns: 8, rows: 8, ..Grid::default() });
    InProcess(PcSensor::new(front_end, pattern, Hardware::REFERENCE))
}

/// Puts a frame of its own in front of the n-th message to the sensor.
struct Intruder<T> {
    inner: T,
    sent: usize,
    before: usize,
    first: Vec<u8>,
    /// What to say; `None` says the first message again.
    frame: Option<Vec<u8>>,
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
fn a_hello_that_comes_late_costs_nothing() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    for before in 1..6 {
        let line = Intruder { inner: sensor(), sent: 0, before, first: Vec::new(), frame: None };
        let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
        client.configure(&wanted).unwrap();
        assert_eq!(client.read_settings().unwrap(), wanted, "before message {before}");
        assert_eq!(client.read_counters().unwrap().stale, u32::from(before > 1));
    }
}

#[test]
fn a_program_that_begins_just_behind_another_is_heard_all_the_same() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let line = Shared(Rc::new(RefCell::new(sensor())));
    for behind in 0..300 {
        let mut first = Client::connect_from(line.clone(), retry_policy, 1_000).unwrap();
        first.read_counters().unwrap();
        let mut second = Client::connect_from(line.clone(), retry_policy, 1_003 - behind).unwrap();
        let wanted = Settings { gain_cdb: i32::from(behind), ..Settings::default() };
        second.configure(&wanted).unwrap();
        assert_eq!(second.read_settings().unwrap(), wanted, "{behind} behind");
    }
}

#[test]
fn a_hello_and_a_forget_that_come_late_do_not_forget_what_was_saved_since() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let mut client = Client::connect_from(sensor(), retry_policy, 0).unwrap(); // hello is number 1
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
fn an_earlier_program_s_late_command_does_not_deafen_the_sensor() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    for sequence in [300, 1_000, 40_000, 65_535] {
        for before in 1..4 {
            let frame =
                encode(sequence, &Command::ReadCounters, &mut [0; MAX_FRAME]).unwrap().to_vec();
            let line = Intruder {
                inner: sensor(),
                sent: 0,
                before,
                first: Vec::new(),
                frame: Some(frame),
            };
            let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
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
fn a_late_command_that_could_be_ours_deafens_the_sensor_until_the_next_hello() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 2 };
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    for before in 2..4 {
        let frame = encode(100, &Command::ReadCounters, &mut [0; MAX_FRAME]).unwrap().to_vec();
        let line =
            Intruder { inner: sensor(), sent: 0, before, first: Vec::new(), frame: Some(frame) };
        let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
        assert!(matches!(client.configure(&wanted), Err(ClientError::Silent { .. })));
        client.configure(&wanted).unwrap();
        assert_eq!(client.read_settings().unwrap(), wanted, "before message {before}");
    }
}

#[test]
fn a_sensor_that_was_switched_off_and_on_says_so_and_is_set_anew() {
    let retry_policy = RetryPolicy { timeout: Duration::from_secs(1), tries: 1 };
    // Past half of all sequence numbers, which a fresh sensor could take for old ones.
    let mut client = Client::connect_from(sensor(), retry_policy, 40_000).unwrap();
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    client.configure(&wanted).unwrap();
    *client.transport_mut() = sensor();
    assert!(matches!(client.scan(1), Err(ClientError::Nack(Nack::NotReady))));
    assert_eq!(client.read_settings().unwrap(), Settings::default());
    client.configure(&wanted).unwrap();
    assert_eq!(client.read_settings().unwrap(), wanted);
}

/// A line that never falls quiet and never makes sense.
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
fn a_line_that_never_falls_quiet_is_given_up_in_time() {
    let retry_policy = RetryPolicy { timeout: Duration::from_millis(10), tries: 3 };
    let began = Instant::now();
    assert!(matches!(
        Client::connect(Babble, retry_policy),
        Err(ClientError::Silent { tries: 3, .. })
    ));
    assert!(began.elapsed() < Duration::from_secs(5));
}

#[test]
fn programs_begin_to_count_at_different_numbers() {
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
