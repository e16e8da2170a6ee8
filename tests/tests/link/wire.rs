//! Bytes on the link: frozen, documented, and accepted only with a right checksum.

use std::io;
use std::time::Duration;

use echoloop_dsp::settings::PARAMETERS;
use echoloop_dsp::{
    Echo, Echoes, Flags, Grid, Hardware, ParameterId, Reason, Refusal, ScanPattern, Settings,
    SpinningModel,
};
use echoloop_link::{
    BEAMS_PER_REPORT, Command, Counters, Decoder, FrameError, Greeting, MAX_FRAME, MAX_PAYLOAD,
    Message, Nack, Noise, PACKED_BYTES, PROTOCOL, Place, Report, Room, SCHEMA, Times, Way, decode,
    encode, encode_for, settings_hash,
};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::Transport;
use echoloop_tests::faults::Target;
use echoloop_tests::vectors;
use proptest::collection::vec;
use proptest::prelude::{any, prop_assert, prop_assert_eq, prop_oneof, proptest};
use rand::RngExt;

fn frame(sequence: u16, body: &impl Message) -> Vec<u8> {
    encode(sequence, body, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

/// Payload without checksum: sequence number and body.
fn payload(body: &impl Message) -> Vec<u8> {
    let mut bytes = frame(0x1234, body);
    let inner = bytes.len() - 1;
    let length = cobs::decode_in_place(&mut bytes[1..inner]).unwrap();
    bytes[1..1 + length - 4].to_vec()
}

/// A byte string in postcard: its length as a varint, and the bytes.
fn postcard_bytes(body: &[u8]) -> Vec<u8> {
    let length = body.len() as u8;
    let head =
        if body.len() < 128 { vec![length] } else { vec![length | 0x80, (body.len() >> 7) as u8] };
    [head, body.to_vec()].concat()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ")
}

fn echo() -> Echo {
    Echo {
        range: 2_560_000,
        amplitude: 4_096,
        width: 115,
        snr: 3_200,
        deviation: 2_048,
        reflectivity: 512,
        flags: Flags::SATURATED,
    }
}

fn echoes(count: usize) -> Echoes {
    (0..count).map(|_| echo()).collect()
}

/// Worked examples of WIRE.md, by name.
fn examples() -> Vec<(&'static str, Vec<u8>)> {
    let hash = settings_hash(&Settings::default());
    let refusal = Refusal {
        field: ParameterId::Power,
        value: 100_000_000,
        reason: Reason::EnergyAboveLimit { energy_pj: 500_000, limit_pj: 400_000 },
    };
    let beams = Report::Beams {
        frame: 1,
        first: 32,
        generation: 1,
        hash,
        beams: [echoes(1), echoes(0)].into_iter().collect(),
    };
    vec![
        ("hello", frame(1, &Command::Hello(Greeting::OURS))),
        ("hello-reply", frame(1, &hello_reply())),
        ("stage", frame(2, &Command::Stage(Settings::default()))),
        ("staged", frame(2, &Report::Staged { hash })),
        ("commit", frame(3, &Command::Commit { hash, base_generation: 0, confirm_within: 3 })),
        ("committed", frame(3, &Report::Committed { generation: 1, hash })),
        ("refused", frame(4, &Report::Refused(refusal))),
        ("read-beams", frame(5, &Command::ReadBeams { frame: 1, first: 32, count: 2 })),
        ("beams", frame(5, &beams)),
        ("confirm", frame(6, &Command::Confirm { generation: 1 })),
        ("confirmed", frame(6, &Report::Confirmed { generation: 1 })),
        ("save", frame(7, &Command::Save { hash })),
        ("saved", frame(7, &Report::Saved { hash, revision: 5 })),
        ("forget", frame(8, &Command::Forget)),
        ("forgotten", frame(8, &Report::Forgotten)),
        ("read-room", frame(9, &Command::ReadRoom)),
        ("room", frame(9, &Report::Room(ROOM))),
        ("read-noisy-beams", frame(10, &READ_NOISY_BEAMS)),
        ("waveforms", frame(11, &Command::Waveforms { frame: 1, from: FROM, packed: &PACKED })),
        ("awaited", frame(11, &Report::Nack(Nack::Awaited { place: FROM }))),
        ("set-deadline", frame(12, &Command::SetDeadline { scan_us: 100_000 })),
        (
            "times",
            frame(12, &Report::Times(Times { last_us: 99_000, longest_us: 132_000, ..TIMES })),
        ),
    ]
}

const ROOM: Room = Room { codes: 2_528, frames: 2 };
const TIMES: Times = Times {
    clock: true,
    deadline_us: 100_000,
    scans: 3,
    late: 1,
    last_us: u32::MAX,
    longest_us: u32::MAX,
};
const READ_NOISY_BEAMS: Command<'_> = Command::ReadNoisyBeams {
    frame: 7,
    first: 32,
    count: 2,
    noise: Noise { scan: 1, seed: 0x0123_4567_89AB_CDEF },
};
/// Codes 0xABC and 0x123.
const PACKED: [u8; 3] = [0xBC, 0x3A, 0x12];
const FROM: Place = Place { beam: 300, shot: 1, sample: 798 };

fn hello_reply() -> Report {
    Report::Hello {
        greeting: Greeting::OURS,
        build: "echoloop-sensor 0.1.0".try_into().unwrap(),
        hardware: Hardware::REFERENCE,
        pattern: ScanPattern::default(),
    }
}

#[test]
fn every_worked_example_of_the_document_is_right() {
    let document = include_str!("../../../firmware/link/WIRE.md");
    let worked = document.split("## Worked bytes").nth(1).unwrap();
    let examples = examples();
    let lines = worked
        .lines()
        .filter_map(|line| line.strip_prefix('`')?.strip_suffix('`')?.split_once("`: `"));
    assert_eq!(lines.clone().count(), examples.len());
    for (said, (name, made)) in lines.zip(&examples) {
        assert_eq!(said, (*name, hex(made).as_str()));
    }
    let annotated = worked.split("```").nth(1).unwrap().lines().skip(1);
    let bytes: Vec<&str> =
        annotated.flat_map(|l| l.get(..30).unwrap_or(l).split_whitespace()).collect();
    assert_eq!(bytes.join(" "), hex(&examples[0].1), "hello, line by line");
}

#[test]
fn a_changed_schema_needs_a_changed_protocol() {
    // To change a message: append, raise PROTOCOL, and write both new values here and in WIRE.md.
    assert_eq!((PROTOCOL, SCHEMA), (11, 0xcd4d_5ce5_16fb_5ed4), "the schema is {SCHEMA:#018x}");
    let document = include_str!("../../../firmware/link/WIRE.md");
    let line = format!("Protocol {PROTOCOL}, schema\n`{SCHEMA:#018x}`");
    assert!(document.contains(&line), "WIRE.md should have\n{line}");
}

#[test]
fn the_greeting_never_changes() {
    let bytes = payload(&Command::Hello(Greeting {
        magic: *b"ECHO",
        protocol: 0x0102,
        schema: 0x0304_0506_0708_090a,
    }));
    assert_eq!(hex(&bytes), "34 12 00 45 43 48 4f 02 01 0a 09 08 07 06 05 04 03");
}

/// One command of each kind, by number.
fn commands() -> [Command<'static>; 14] {
    [
        Command::Hello(Greeting::OURS),
        Command::Stage(Settings::default()),
        Command::Commit { hash: 0, base_generation: 0, confirm_within: 0 },
        Command::ReadSettings,
        Command::ReadBeams { frame: 0, first: 0, count: 0 },
        Command::ReadCounters,
        Command::Confirm { generation: 0 },
        Command::Save { hash: 0 },
        Command::Forget,
        Command::ReadRoom,
        READ_NOISY_BEAMS,
        Command::Waveforms { frame: 0, from: Place::default(), packed: &PACKED },
        Command::SetDeadline { scan_us: 0 },
        Command::ReadTimes,
    ]
}

const REFUSAL: Refusal =
    Refusal { field: ParameterId::EchoChoice, value: -1, reason: Reason::NotAChoice };

/// One report of each kind, by number.
fn reports() -> [Report; 13] {
    [
        hello_reply(),
        Report::Nack(Nack::NotReady),
        Report::Refused(REFUSAL),
        Report::Staged { hash: 0 },
        Report::Committed { generation: 0, hash: 0 },
        Report::Settings { generation: 0, hash: 0, settings: Settings::default() },
        Report::Beams { frame: 0, first: 0, generation: 0, hash: 0, beams: heapless::Vec::new() },
        Report::Counters(Counters::default()),
        Report::Confirmed { generation: 0 },
        Report::Saved { hash: 0, revision: 0 },
        Report::Forgotten,
        Report::Room(ROOM),
        Report::Times(TIMES),
    ]
}

#[test]
fn every_pattern_keeps_its_number() {
    for (number, pattern) in ScanPattern::EXAMPLES.into_iter().enumerate() {
        let Report::Hello { greeting, build, hardware, .. } = hello_reply() else {
            panic!("a hello")
        };
        // The answer ends with the grid's number and its nine bytes.
        let before = payload(&hello_reply()).len() - 10;
        let bytes = payload(&Report::Hello { greeting, build, hardware, pattern });
        assert_eq!(bytes[before], number as u8, "{pattern:?}");
    }
    for (number, model) in SpinningModel::ALL.into_iter().enumerate() {
        assert_eq!(model as usize, number, "{model:?}");
    }
}

#[test]
fn every_message_decodes_as_it_was_encoded() {
    for (name, mut bytes) in examples() {
        let inner = bytes.len() - 1;
        let copy = bytes.clone();
        if let Ok((sequence, command)) = decode::<Command>(&mut bytes[1..inner]) {
            assert_eq!(frame(sequence, &command), copy, "{name}");
        } else {
            bytes.clone_from(&copy);
            let (sequence, report) = decode::<Report>(&mut bytes[1..inner]).unwrap();
            assert_eq!(frame(sequence, &report), copy, "{name}");
        }
    }
}

#[test]
fn the_fullest_report_fits_a_frame() {
    let most = u16::MAX;
    let widest = Echo {
        range: u32::MAX,
        amplitude: most,
        width: most,
        snr: most,
        deviation: most,
        reflectivity: most,
        flags: Flags(u8::MAX),
    };
    let beams = (0..BEAMS_PER_REPORT).map(|_| (0..4).map(|_| widest).collect()).collect();
    let report = Report::Beams {
        frame: u32::MAX,
        first: u32::MAX,
        generation: u32::MAX,
        hash: u32::MAX,
        beams,
    };
    assert!(encode(u16::MAX, &report, &mut [0; MAX_FRAME]).is_ok());
}

#[test]
fn the_most_codes_behind_the_widest_numbers_fill_a_frame() {
    let from = Place { beam: u32::MAX, shot: u16::MAX, sample: u16::MAX };
    let fullest = |bytes: usize| {
        let command =
            Command::Waveforms { frame: u32::MAX, from, packed: &[0xA5; MAX_PAYLOAD][..bytes] };
        encode(u16::MAX, &command, &mut [0; MAX_FRAME]).map(<[u8]>::len)
    };
    assert!(fullest(PACKED_BYTES).is_ok());
    assert_eq!(fullest(PACKED_BYTES + 2), Err(FrameError::TooLong), "hardly a byte is left");
}

/// Sequence number, body and checksum of a frame, before COBS.
fn unstuffed(frame: &[u8]) -> Vec<u8> {
    let mut bytes = frame[1..frame.len() - 1].to_vec();
    let length = cobs::decode_in_place(&mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

/// A payload after COBS, without delimiters.
fn stuffed(payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; payload.len() + payload.len() / 254 + 2];
    let length = cobs::encode(payload, &mut bytes);
    bytes.truncate(length);
    bytes
}

/// As [`stuffed`], of a payload without its checksum.
fn sealed(payload: &[u8]) -> Vec<u8> {
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(payload);
    stuffed(&[payload, &checksum.to_le_bytes()].concat())
}

#[test]
fn a_frame_of_one_direction_is_never_accepted_in_the_other() {
    let echo = FrameError::Echo { sequence: 0x1234 };
    for command in commands() {
        let bytes = frame(0x1234, &command);
        let inner = bytes[1..bytes.len() - 1].to_vec();
        assert_eq!(decode::<Report>(&mut inner.clone()), Err(echo), "{command:?}");
        assert!(decode::<Command<'_>>(&mut inner.clone()).is_ok(), "{command:?}");
    }
    for report in reports() {
        let bytes = frame(0x1234, &report);
        let inner = bytes[1..bytes.len() - 1].to_vec();
        assert_eq!(decode::<Command<'_>>(&mut inner.clone()), Err(echo), "{report:?}");
        assert!(decode::<Report>(&mut inner.clone()).is_ok(), "{report:?}");
    }
}

fn sensor() -> PcSensor<Target> {
    let pattern = ScanPattern::Grid(Grid { columns: 2, rows: 1, ..Grid::default() });
    PcSensor::new(Target::default(), pattern, Hardware::REFERENCE)
}

#[test]
fn a_sensor_counts_its_own_echoed_answers_and_stays_silent() {
    let mut sensor = sensor();
    for report in reports() {
        sensor.send(&frame(1, &report));
    }
    assert_eq!(sensor.receive(&mut [0; 64]), 0);
    let counters = sensor.session().counters;
    assert_eq!(counters, Counters { echoes: reports().len() as u32, ..Counters::default() });
}

/// Line that echoes what is sent, with a sensor or without.
struct Echoing {
    sensor: Option<PcSensor<Target>>,
    back: Vec<u8>,
}

impl Transport for Echoing {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.back.extend(bytes);
        if let Some(sensor) = &mut self.sensor {
            sensor.send(bytes);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> io::Result<usize> {
        if !self.back.is_empty() {
            let length = self.back.len().min(buffer.len());
            buffer[..length].copy_from_slice(&self.back[..length]);
            self.back.drain(..length);
            return Ok(length);
        }
        Ok(self.sensor.as_mut().map_or(0, |sensor| sensor.receive(buffer)))
    }
}

const TWICE: RetryPolicy = RetryPolicy { timeout: Duration::from_secs(1), tries: 2 };

#[test]
fn a_line_that_only_echoes_is_reported_as_such() {
    let line = Echoing { sensor: None, back: Vec::new() };
    let error = Client::connect(line, TWICE).err().unwrap();
    assert!(matches!(error, ClientError::Echo { command: "hello", echoes: 2 }), "{error}");
}

#[test]
fn one_wire_for_both_directions_works() {
    let line = Echoing { sensor: Some(sensor()), back: Vec::new() };
    let mut client = Client::connect(line, TWICE).unwrap();
    let wanted = Settings { gain_cdb: 7, ..Settings::default() };
    client.configure(&wanted).unwrap();
    assert_eq!(client.read_settings().unwrap(), wanted);
    assert_eq!(client.scan(1).unwrap().len(), 2);
}

/// Hosts of protocol 9 do not know the mark, and must be able to read why they are refused.
#[test]
fn only_a_hello_of_another_protocol_is_answered_without_the_mark_of_direction() {
    let ways = |command: &Command<'_>, sensor: &mut PcSensor<Target>| {
        sensor.send(&frame(5, command));
        let mut bytes = vec![0; 256];
        let length = sensor.receive(&mut bytes);
        let (way, _, body) = echoloop_link::open(&mut bytes[1..length - 1]).unwrap();
        (way, Greeting::from_answer(body))
    };
    let older = Greeting { protocol: 9, schema: 1, ..Greeting::OURS };
    let mut sensor = sensor();
    let hello = ways(&Command::Hello(older), &mut sensor);
    assert_eq!(hello, (Way::ToSensor, Some(Greeting::OURS)));
    assert_eq!(ways(&Command::ReadCounters, &mut sensor), (Way::ToHost, None), "not ready");
    let hello = ways(&Command::Hello(Greeting::OURS), &mut sensor);
    assert_eq!(hello, (Way::ToHost, Some(Greeting::OURS)));
}

/// COBS is whole and the body may be a message: only the checksum shows the damage.
#[test]
fn the_checksum_detects_one_wrong_bit_or_byte_of_any_message() {
    let commands = commands().map(|command| frame(0x1234, &command));
    let reports = reports().map(|report| frame(0x1234, &report));
    for whole in commands.iter().chain(&reports) {
        let payload = unstuffed(whole);
        let kind = payload[2];
        let refused = |damaged: &[u8]| {
            let bytes = stuffed(damaged);
            let mut copy = bytes.clone();
            let command = decode::<Command<'_>>(&mut copy);
            assert_eq!(command, Err(FrameError::Crc), "kind {kind}: {damaged:02x?}");
            let report = decode::<Report>(&mut bytes.clone());
            assert_eq!(report, Err(FrameError::Crc), "kind {kind}: {damaged:02x?}");
            let opened = echoloop_link::open(&mut bytes.clone()).map(|(_, number, _)| number);
            assert_eq!(opened, Err(FrameError::Crc), "kind {kind}: {damaged:02x?}");
        };
        for at in 0..payload.len() {
            for bit in 0..8 {
                let mut damaged = payload.clone();
                damaged[at] ^= 1 << bit;
                refused(&damaged);
            }
            let mut shorter = payload.clone();
            shorter.remove(at);
            refused(&shorter);
            let mut longer = payload.clone();
            longer.insert(at, 0xA5);
            refused(&longer);
        }
    }
}

/// Frames and errors that a decoder gives for some bytes.
fn feed(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Result<Vec<u8>, FrameError>> {
    bytes
        .iter()
        .filter_map(|&byte| decoder.push(byte).map(|frame| frame.map(|f| f.to_vec())))
        .collect()
}

#[test]
fn the_next_whole_frame_after_any_garbage_is_decoded() {
    let mut rng = vectors::rng(6);
    let mut decoder = Decoder::new();
    let whole = frame(9, &Command::ReadSettings);
    for _ in 0..2_000 {
        let garbage: Vec<u8> = (0..rng.random_range(0..4_000)).map(|_| rng.random()).collect();
        feed(&mut decoder, &garbage);
        let mut last = feed(&mut decoder, &whole).pop().unwrap().unwrap();
        assert_eq!(decode::<Command>(&mut last), Ok((9, Command::ReadSettings)));
    }
}

#[test]
fn the_tail_of_an_overlong_frame_is_never_a_frame() {
    let whole = frame(9, &Command::ReadSettings);
    let mut long = vec![1; MAX_FRAME];
    long.extend(&whole[1..]);
    let mut decoder = Decoder::new();
    assert_eq!(feed(&mut decoder, &long), [Err(FrameError::TooLong)]);
}

#[test]
fn nothing_may_follow_a_body() {
    let mut payload = payload(&Command::ReadSettings);
    payload.push(0);
    let body = FrameError::Body { sequence: 0x1234 };
    assert_eq!(decode::<Command>(&mut sealed(&payload)), Err(body));
}

/// Bodies of every variant, encoded by hand with WIRE.md's rules.
#[test]
fn every_variant_has_these_bytes() {
    let hash = 0x1234_5678;
    let commands = [
        (
            Command::Commit { hash, base_generation: 300, confirm_within: 129 },
            "02 f8 ac d1 91 01 ac 02 81 01",
        ),
        (Command::ReadSettings, "03"),
        (Command::ReadBeams { frame: 70_000, first: 200, count: 32 }, "04 f0 a2 04 c8 01 20"),
        (Command::ReadCounters, "05"),
        (Command::Confirm { generation: 300 }, "06 ac 02"),
        (Command::Save { hash }, "07 f8 ac d1 91 01"),
        (Command::Forget, "08"),
        (Command::ReadRoom, "09"),
        (READ_NOISY_BEAMS, "0a 07 20 02 01 ef 9b af cd f8 ac d1 91 01"),
        (
            Command::Waveforms { frame: 300, from: FROM, packed: &PACKED },
            "0b ac 02 ac 02 01 9e 06 03 bc 3a 12",
        ),
        (Command::SetDeadline { scan_us: 100_000 }, "0c a0 8d 06"),
        (Command::ReadTimes, "0d"),
    ];
    for (command, bytes) in commands {
        assert_eq!(hex(&payload(&command)[2..]), bytes, "{command:?}");
    }
    let refused = |field, value, reason| Report::Refused(Refusal { field, value, reason });
    let settings = Settings { min_separation_mm: Some(855), ..Settings::default() };
    let counters = Counters {
        frames: 1,
        crc_failures: 2,
        cobs_failures: 3,
        overflows: 4,
        unintelligible: 5,
        refusals: 6,
        stale: 300,
        rollbacks: 7,
        restarts: 8,
        echoes: 9,
    };
    use ParameterId as Id;
    let reports = [
        (Report::Nack(Nack::NotReady), "01 00"),
        (Report::Nack(Nack::Unintelligible), "01 01"),
        (Report::Nack(Nack::NotStaged { staged: hash }), "01 02 f8 ac d1 91 01"),
        (Report::Nack(Nack::WrongGeneration { generation: 300 }), "01 03 ac 02"),
        (Report::Nack(Nack::NoSuchBeams { beams: 12_288 }), "01 04 80 60"),
        (Report::Nack(Nack::FrontEnd), "01 05"),
        (Report::Nack(Nack::NotActive { hash }), "01 06 f8 ac d1 91 01"),
        (Report::Nack(Nack::OnTrial), "01 07"),
        (Report::Nack(Nack::Storage), "01 08"),
        (Report::Nack(Nack::Overtaken { newest: 300 }), "01 09 ac 02"),
        (Report::Nack(Nack::Awaited { place: FROM }), "01 0a ac 02 01 9e 06"),
        (
            refused(Id::Gain, -1_001, Reason::BelowMinimum { minimum: -1_000 }),
            "02 02 d1 0f 00 cf 0f",
        ),
        (
            refused(Id::PulseWidth, 25_000, Reason::AboveMaximum { maximum: 20_000 }),
            "02 01 d0 86 03 01 c0 b8 02",
        ),
        (refused(Id::Upsampling, 3, Reason::NotAChoice), "02 08 06 02"),
        (
            refused(
                Id::Power,
                100_000_000,
                Reason::EnergyAboveLimit { energy_pj: 500_000, limit_pj: 400_000 },
            ),
            "02 00 80 84 af 5f 03 a0 c2 1e 80 b5 18",
        ),
        (
            refused(
                Id::Saturation,
                150_000,
                Reason::SaturationNotAboveFloor { floor_ppm: 200_000 },
            ),
            "02 05 e0 a7 12 04 80 b5 18",
        ),
        (
            refused(Id::PulseWidth, 5_000, Reason::Undersampled { sample_period_fs: 3_969_413 }),
            "02 01 90 4e 05 85 a3 f2 01",
        ),
        (
            refused(Id::GainRange, 40_000, Reason::BeyondMiddle { middle_mm: 25_500 }),
            "02 12 80 f1 04 06 9c c7 01",
        ),
        (refused(Id::Tilt, -500, Reason::NotSteered), "02 16 e7 07 07"),
        (
            refused(Id::Tilt, 1_001, Reason::BeyondMount { most_cdeg: 1_000 }),
            "02 16 d2 0f 08 d0 0f",
        ),
        (refused(Id::Rows, 51, Reason::FinerThanRaster { step_cdeg: 20 }), "02 18 66 09 28"),
        (
            refused(Id::FrameTime, 100_000, Reason::FrameTooShort { needed_us: 122_880 }),
            "02 1b c0 9a 0c 0a 80 c0 07",
        ),
        (Report::Staged { hash }, "03 f8 ac d1 91 01"),
        (Report::Committed { generation: 300, hash }, "04 ac 02 f8 ac d1 91 01"),
        (
            Report::Settings { generation: 300, hash, settings },
            "05 ac 02 f8 ac d1 91 01 80 a3 c3 47 90 4e 00 c0 0c 02 80 89 7a c0 3e b8 49 02 04 00 \
             06 01 ae 0d 02 00 00 00 00 80 f1 04 d0 0f 00 00 00 00 00 00 00 00",
        ),
        (
            Report::Beams {
                frame: 1,
                first: 2,
                generation: 3,
                hash: 4,
                beams: heapless::Vec::new(),
            },
            "06 01 02 03 04 00",
        ),
        (Report::Counters(counters), "07 01 02 03 04 05 06 ac 02 07 08 09"),
        (Report::Confirmed { generation: 300 }, "08 ac 02"),
        (Report::Saved { hash, revision: 129 }, "09 f8 ac d1 91 01 81 01"),
        (Report::Forgotten, "0a"),
        (Report::Room(ROOM), "0b e0 13 02"),
        (Report::Times(TIMES), "0c 01 a0 8d 06 03 01 ff ff ff ff 0f ff ff ff ff 0f"),
    ];
    for (report, bytes) in reports {
        assert_eq!(hex(&payload(&report)[2..]), bytes, "{report:?}");
    }
}

#[test]
fn fields_and_flags_keep_their_numbers() {
    let names = [
        "power",
        "pulse_width",
        "gain",
        "waveform_resolution",
        "shots",
        "saturation",
        "noise_floor",
        "snr_threshold",
        "upsampling",
        "denoise",
        "ambient",
        "timing",
        "min_separation",
        "echoes",
        "echo_choice",
        "black_level",
        "dither",
        "gain_slope",
        "gain_range",
        "overlap",
        "azimuth_span",
        "elevation_span",
        "tilt",
        "columns",
        "rows",
        "azimuth_fovea",
        "elevation_fovea",
        "frame_time",
    ];
    assert_eq!(PARAMETERS.map(|p| p.name), names);
    for (number, parameter) in PARAMETERS.iter().enumerate() {
        let refusal = Refusal { field: parameter.id, value: 0, reason: Reason::NotAChoice };
        assert_eq!(payload(&Report::Refused(refusal))[3], number as u8, "{}", parameter.name);
    }
    let flags = [
        Flags::SATURATED,
        Flags::MERGED,
        Flags::LOW_CONFIDENCE,
        Flags::WALK_CORRECTED,
        Flags::TRUNCATED,
    ];
    assert_eq!(flags.map(|f| f.0), [1, 2, 4, 8, 16]);
}

#[test]
fn a_hash_covers_settings_of_any_width() {
    assert_eq!(settings_hash(&Settings::default()), 0x72bc_8b8a);
    let mut settings = Settings::default();
    PARAMETERS.iter().for_each(|p| settings.set(p.id, Some(i32::MIN)));
    let widest = settings_hash(&settings);
    for parameter in &PARAMETERS {
        let mut other = settings;
        other.set(parameter.id, Some(i32::MIN + 1));
        assert_ne!(settings_hash(&other), widest, "{}", parameter.name);
    }
}

/// Cuts, joins, removes, appends, overwrites and flips the bytes between delimiters.
#[test]
fn no_damaged_frame_is_accepted() {
    let mut rng = vectors::rng(7);
    let examples = examples();
    let whole: Vec<&[u8]> = examples.iter().map(|(_, bytes)| &bytes[1..bytes.len() - 1]).collect();
    let mut decoder = Decoder::new();
    let mut tried = 0;
    while tried < 200_000 {
        let one = whole[rng.random_range(0..whole.len())];
        let other = whole[rng.random_range(0..whole.len())];
        let at = rng.random_range(0..one.len());
        let mut bytes = match rng.random_range(0..6) {
            0 => [one, other].concat(),
            1 => [&one[..at], &other[rng.random_range(0..other.len())..]].concat(),
            2 => one[..at].to_vec(),
            3 => [&one[..at], &one[at + 1..]].concat(),
            4 => [one, &rng.random::<[u8; 4]>()[..rng.random_range(1..5)]].concat(),
            _ => one.to_vec(),
        };
        for _ in 0..rng.random_range(0..6) {
            let at = rng.random_range(0..bytes.len().max(1));
            if let Some(byte) = bytes.get_mut(at) {
                *byte =
                    if rng.random() { rng.random() } else { *byte ^ (1 << rng.random_range(0..8)) };
            }
        }
        bytes.push(0);
        for frame in feed(&mut decoder, &bytes) {
            let mut frame = frame.unwrap();
            if whole.contains(&&frame[..]) {
                continue; // a zero fell on a seam, or nothing changed
            }
            tried += 1;
            let mut again = frame.clone();
            assert!(decode::<Command>(&mut frame).is_err(), "{frame:02x?}");
            assert!(decode::<Report>(&mut again).is_err(), "{again:02x?}");
        }
    }
}

proptest! {
    /// Compares with the crate that postcard uses.
    #[test]
    fn our_stuffing_is_that_of_the_cobs_crate(
        zeros in 0..4u8,
        bytes in vec(any::<u8>(), 0..1_000),
    ) {
        let stuffed = |b: u8| match zeros {
            0 => b | 1,
            _ if b < zeros * 8 => 0,
            _ => b,
        };
        let body: Vec<u8> = bytes.iter().map(|&b| stuffed(b)).collect();
        let mut made = [0; MAX_FRAME];
        let mut made = encode_for(Way::ToSensor, 0x0101, &&body[..], &mut made).unwrap().to_vec();
        let theirs = sealed(&[&[1, 1][..], &postcard_bytes(&body)].concat());
        prop_assert_eq!(&made[1..made.len() - 1], &theirs[..]);
        let inner = made.len() - 1;
        let cut = usize::from(zeros).min(inner - 1);
        let torn = &mut made[1..inner - cut];
        let theirs = cobs::decode_in_place(&mut torn.to_vec()).is_ok();
        let ours = decode::<Command>(torn) != Err(FrameError::Cobs);
        prop_assert_eq!(ours, theirs, "{} bytes cut", cut);
    }

    #[test]
    fn the_decoder_accepts_no_random_bytes(bytes in vec(any::<u8>(), 0..5_000)) {
        let mut decoder = Decoder::new();
        for &byte in &bytes {
            if let Some(Ok(frame)) = decoder.push(byte) {
                let mut copy = frame.to_vec();
                prop_assert!(decode::<Command>(frame).is_err());
                prop_assert!(decode::<Report>(&mut copy).is_err());
            }
        }
    }

    /// A faulty sender may send any body with a right checksum.
    #[test]
    fn any_body_is_decoded_as_it_is_or_refused(
        body in vec(prop_oneof![0..12u8, any::<u8>()], 0..200),
    ) {
        let bytes = sealed(&[&[7, 0], &body[..]].concat());
        match decode::<Command>(&mut bytes.clone()) {
            Ok((sequence, command)) => {
                prop_assert_eq!(sequence, 7);
                let mut made = frame(7, &command);
                let inner = made.len() - 1;
                prop_assert_eq!(decode::<Command>(&mut made[1..inner]), Ok((7, command)));
            }
            Err(error) => prop_assert_eq!(error, FrameError::Body { sequence: 7 }),
        }
        let report = decode::<Report>(&mut bytes.clone());
        prop_assert_eq!(report, Err(FrameError::Echo { sequence: 7 }));
    }
}

/// A sensor that answers every command with the same body.
struct Foreign {
    body: Vec<u8>,
    heard: Decoder,
    sent: Vec<u8>,
}

impl Transport for Foreign {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            if let Some(Ok(frame)) = self.heard.push(byte) {
                let (_, sequence, _) = echoloop_link::open(frame).unwrap();
                let inner = sealed(&[&sequence.to_le_bytes()[..], &self.body].concat());
                self.sent = [&[0], &inner[..], &[0]].concat();
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> io::Result<usize> {
        let sent = std::mem::take(&mut self.sent);
        buffer[..sent.len()].copy_from_slice(&sent);
        Ok(sent.len())
    }
}

#[test]
fn a_sensor_of_another_version_is_refused_with_both_versions() {
    let theirs = Greeting { protocol: PROTOCOL + 1, schema: SCHEMA ^ 1, ..Greeting::OURS };
    let Report::Hello { build, hardware, pattern, .. } = hello_reply() else { panic!() };
    let same = payload(&Report::Hello { greeting: theirs, build, hardware, pattern })[2..].to_vec();
    let longer = [&same[..], &[7; 5]].concat();
    let shorter = same[..1 + 14].to_vec();
    for body in [same, longer, shorter] {
        let sensor = Foreign { body: body.clone(), heard: Decoder::new(), sent: Vec::new() };
        let retry_policy = RetryPolicy { timeout: Duration::from_millis(10), tries: 2 };
        let error = Client::connect(sensor, retry_policy).err().unwrap();
        assert!(
            matches!(error, ClientError::Version { theirs: found, .. } if found == theirs),
            "{body:x?}: {error}"
        );
        let text = error.to_string();
        for version in
            [PROTOCOL.to_string(), theirs.protocol.to_string(), format!("{SCHEMA:#018x}")]
        {
            assert!(text.contains(&version), "{text}");
        }
    }
}
