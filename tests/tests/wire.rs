//! The bytes on the link: frozen, documented, and distrusted until their checksum holds.
#![allow(clippy::unwrap_used, reason = "tests")]

use echoloop_dsp::{Echo, Echoes, Flags, Hardware, ParameterId, Reason, Refusal, ScanPattern, Settings};
use echoloop_link::{
    BEAMS_PER_REPORT, Command, Counters, Decoder, FrameError, Greeting, MAX_FRAME, Nack, PROTOCOL, Report, SCHEMA,
    decode, encode, settings_hash,
};
use echoloop_tests::vectors;
use rand::RngExt;
use serde::Serialize;

fn frame(sequence: u16, body: &impl Serialize) -> Vec<u8> {
    encode(sequence, body, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

/// Payload without its checksum: sequence and body.
fn payload(body: &impl Serialize) -> Vec<u8> {
    let mut bytes = frame(0x1234, body);
    let inner = bytes.len() - 1;
    let length = cobs::decode_in_place(&mut bytes[1..inner]).unwrap();
    bytes[1..1 + length - 4].to_vec()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ")
}

fn echo() -> Echo {
    Echo { range: 2_560_000, amplitude: 4_096, width: 115, snr: 3_200, flags: Flags::SATURATED }
}

fn echoes(count: usize) -> Echoes {
    (0..count).map(|_| echo()).collect()
}

/// What WIRE.md works through, by the name it gives it.
fn examples() -> Vec<(&'static str, Vec<u8>)> {
    let hash = settings_hash(&Settings::default());
    let refusal = Refusal {
        field: ParameterId::Power,
        value: 10_000,
        reason: Reason::EnergyAboveLimit { energy_pj: 500_000, limit_pj: 400_000 },
    };
    let beams =
        Report::Beams { frame: 1, first: 32, generation: 1, hash, beams: [echoes(1), echoes(0)].into_iter().collect() };
    vec![
        ("hello", frame(1, &Command::Hello(Greeting::OURS))),
        ("hello-reply", frame(1, &hello_reply())),
        ("stage", frame(2, &Command::Stage(Settings::default()))),
        ("staged", frame(2, &Report::Staged { hash })),
        ("commit", frame(3, &Command::Commit { hash, base_generation: 0 })),
        ("committed", frame(3, &Report::Committed { generation: 1, hash })),
        ("refused", frame(4, &Report::Refused(refusal))),
        ("read-beams", frame(5, &Command::ReadBeams { frame: 1, first: 32, count: 2 })),
        ("beams", frame(5, &beams)),
    ]
}

fn hello_reply() -> Report {
    Report::Hello {
        greeting: Greeting::OURS,
        build: "echoloop-sensor 0.1.0".try_into().unwrap(),
        hardware: Hardware::REFERENCE,
        pattern: ScanPattern::default(),
    }
}

#[test]
fn the_document_s_worked_bytes_are_those_of_the_code() {
    let document = include_str!("../../firmware/link/WIRE.md");
    for (name, bytes) in examples() {
        let line = format!("`{name}`: `{}`", hex(&bytes));
        assert!(document.contains(&line), "WIRE.md should have\n{line}");
    }
}

#[test]
fn a_changed_schema_needs_a_changed_protocol() {
    // To change a message: append, raise PROTOCOL, and write both new values here and in WIRE.md.
    assert_eq!((PROTOCOL, SCHEMA), (1, 0x1396_8d79_a2b0_b7a3), "the schema is {SCHEMA:#018x}");
    let document = include_str!("../../firmware/link/WIRE.md");
    assert!(document.contains(&format!("{SCHEMA:#018x}")));
}

#[test]
fn the_greeting_never_changes() {
    let bytes = payload(&Command::Hello(Greeting { magic: *b"ECHO", protocol: 0x0102, schema: 0x0304_0506_0708_090a }));
    assert_eq!(hex(&bytes), "34 12 00 45 43 48 4f 02 01 0a 09 08 07 06 05 04 03");
}

#[test]
fn every_message_keeps_its_number() {
    let commands = [
        Command::Hello(Greeting::OURS),
        Command::Stage(Settings::default()),
        Command::Commit { hash: 0, base_generation: 0 },
        Command::ReadSettings,
        Command::ReadBeams { frame: 0, first: 0, count: 0 },
        Command::ReadCounters,
    ];
    for (number, command) in commands.iter().enumerate() {
        assert_eq!(payload(command)[2], number as u8, "{command:?}");
    }
    let refusal = Refusal { field: ParameterId::EchoChoice, value: -1, reason: Reason::NotAChoice };
    let reports = [
        hello_reply(),
        Report::Nack(Nack::NotReady),
        Report::Refused(refusal),
        Report::Staged { hash: 0 },
        Report::Committed { generation: 0, hash: 0 },
        Report::Settings { generation: 0, hash: 0, settings: Settings::default() },
        Report::Beams { frame: 0, first: 0, generation: 0, hash: 0, beams: heapless::Vec::new() },
        Report::Counters(Counters::default()),
    ];
    for (number, report) in reports.iter().enumerate() {
        assert_eq!(payload(report)[2], number as u8, "{report:?}");
    }
    let nacks = [
        Nack::NotReady,
        Nack::Unintelligible,
        Nack::NotStaged { staged: 0 },
        Nack::WrongGeneration { generation: 0 },
        Nack::NoSuchBeams { beams: 0 },
        Nack::FrontEnd,
    ];
    for (number, nack) in nacks.into_iter().enumerate() {
        assert_eq!(payload(&Report::Nack(nack))[3], number as u8, "{nack:?}");
    }
    let reasons = [
        Reason::BelowMinimum { minimum: 0 },
        Reason::AboveMaximum { maximum: 0 },
        Reason::NotAChoice,
        Reason::NotImplemented,
        Reason::EnergyAboveLimit { energy_pj: 0, limit_pj: 0 },
        Reason::SaturationNotAboveFloor { floor_ppm: 0 },
        Reason::Undersampled { sample_period_fs: 0 },
    ];
    for (number, reason) in reasons.into_iter().enumerate() {
        let bytes = payload(&Report::Refused(Refusal { reason, ..refusal }));
        assert_eq!(hex(&bytes[3..5]), "0e 01", "field 14, value −1");
        assert_eq!(bytes[5], number as u8, "{reason:?}");
    }
}

#[test]
fn every_message_comes_back_as_it_was_sent() {
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
    let widest = Echo { range: u32::MAX, amplitude: u16::MAX, width: u16::MAX, snr: u16::MAX, flags: Flags(u8::MAX) };
    let beams = (0..BEAMS_PER_REPORT).map(|_| (0..4).map(|_| widest).collect()).collect();
    let report = Report::Beams { frame: u32::MAX, first: u32::MAX, generation: u32::MAX, hash: u32::MAX, beams };
    assert!(encode(u16::MAX, &report, &mut [0; MAX_FRAME]).is_ok());
}

#[test]
fn no_damaged_frame_is_taken_for_another() {
    let mut rng = vectors::rng(5);
    let examples = examples();
    let mut accepted = 0;
    for _ in 0..200_000 {
        let (_, original) = &examples[rng.random_range(0..examples.len())];
        let mut bytes = original[1..original.len() - 1].to_vec();
        match rng.random_range(0..4) {
            0 => {
                for _ in 0..rng.random_range(1..4) {
                    let at = rng.random_range(0..bytes.len());
                    bytes[at] ^= 1 << rng.random_range(0..8);
                }
            }
            1 => bytes.truncate(rng.random_range(0..bytes.len())),
            2 => bytes.extend((0..rng.random_range(1..5)).map(|_| rng.random_range(1..=255u8))),
            _ => {
                let at = rng.random_range(0..bytes.len());
                bytes.remove(at);
            }
        }
        if bytes[..] == original[1..original.len() - 1] {
            continue; // two flips may undo each other
        }
        let mut again = bytes.clone();
        accepted += usize::from(decode::<Command>(&mut bytes).is_ok() || decode::<Report>(&mut again).is_ok());
    }
    assert_eq!(accepted, 0);
}

/// Feeds bytes to a decoder; what it gives.
fn feed(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Result<Vec<u8>, FrameError>> {
    bytes.iter().filter_map(|&byte| decoder.push(byte).map(|frame| frame.map(|f| f.to_vec()))).collect()
}

#[test]
fn after_any_garbage_the_next_whole_frame_is_understood() {
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
fn the_tail_of_an_over_long_frame_is_never_a_frame() {
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
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&payload);
    payload.extend(checksum.to_le_bytes());
    let mut bytes = vec![0; 64];
    let length = cobs::encode(&payload, &mut bytes);
    assert_eq!(decode::<Command>(&mut bytes[..length]), Err(FrameError::Body { sequence: 0x1234 }));
}
