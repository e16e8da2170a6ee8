//! Properties of link, session, store and waveforms on any bytes. The fuzz targets in `fuzz/` and
//! the ordinary tests call these functions.
//!
//! | function | bytes are | property, besides that nothing panics |
//! |---|---|---|
//! | [`frame_decoder`] | a line's, or a payload's | an accepted message decodes again as it was |
//! | [`session`] | commands, noise, restarts, power cuts | a generation names one set of settings |
//! | [`store`] | a flash's | loaded settings pass the check; saved settings are loaded |
//! | [`waveforms`] | settings, hardware, codes; a file | kernels agree; echoes lie in it, sorted |
//!
//! In a session, active settings also pass the check, and saved settings have been active.

use std::collections::HashMap;
use std::fmt::Debug;
use std::fs;
use std::path::Path;

use echoloop_dsp::loops::{Portable, Scalar};
use echoloop_dsp::settings::PARAMETERS;
use echoloop_dsp::{Grid, Hardware, Pipeline, ScanPattern, Scratch, Settings};
use echoloop_instruments::finder::colour::{Colour, LAGS};
use echoloop_instruments::finder::{EchoFinder, FinderConfig, Pulse};
use echoloop_instruments::{Finder, Options, Selection, parse_waveforms};
use echoloop_link::{
    Command, Decoder, Greeting, MAX_FRAME, Message, Noise, PACKED_BYTES, Place, Report,
    SETTINGS_SCHEMA, Way, checksum, decode, encode, encode_for, settings_hash,
};
use echoloop_sensor::store::{MAGIC, forget, load, save};
use echoloop_sensors::boards::nor_flash::RamNorFlash;
use echoloop_sensors::boards::pc::PcSensor;
use serde::ser::SerializeTuple;
use serde::{Deserialize, Serialize, Serializer};

use crate::faults::Target;

/// Corpus of a fuzz target: the inputs that fuzzing kept, one line of hexadecimal digits each.
///
/// # Panics
///
/// When `fuzz/corpus` has no file for the target.
pub fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus");
    let text = fs::read_to_string(folder.join(target).with_extension("hex")).expect("a corpus");
    let byte = |pair: &[u8]| {
        let digits = str::from_utf8(pair).expect("digits");
        u8::from_str_radix(digits, 16).expect("hexadecimal")
    };
    text.lines().map(|line| line.as_bytes().chunks(2).map(byte).collect()).collect()
}

const HARDWARE: Hardware = Hardware::REFERENCE;

/// Message body of any bytes, to be framed with a right checksum.
struct Raw<'a>(&'a [u8]);

impl Serialize for Raw<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
        tuple.end()
    }
}

/// Checks that an accepted frame, encoded again, decodes to the same message.
fn decodes_again<'a, T>(frame: &'a mut [u8], again: &'a mut [u8; MAX_FRAME])
where
    T: Message + Deserialize<'a> + PartialEq + Debug,
{
    let Ok((sequence, message)) = decode::<T>(frame) else { return };
    let length = encode(sequence, &message, again).expect("what came in a frame fits one").len();
    let mut decoder = Decoder::new();
    let mut frames = again[..length]
        .iter()
        .filter_map(|&byte| decoder.push(byte).map(|frame| frame.map(|f| f.to_vec())));
    let frame = frames.next().expect("a frame ends").expect("it is not too long");
    again[..frame.len()].copy_from_slice(&frame);
    assert_eq!(decode::<T>(&mut again[..frame.len()]), Ok((sequence, message)));
}

/// Decodes any bytes, as they are and as the body of a frame.
pub fn frame_decoder(bytes: &[u8]) {
    let mut decoder = Decoder::new();
    let framed = [Way::ToSensor, Way::ToHost].map(|way| {
        let mut frame = [0; MAX_FRAME];
        encode_for(way, 7, &Raw(bytes), &mut frame).unwrap_or_default().to_vec()
    });
    for &byte in bytes.iter().chain(framed.iter().flatten()) {
        if let Some(Ok(frame)) = decoder.push(byte) {
            let mut again = [0; MAX_FRAME];
            decodes_again::<Report>(&mut frame.to_vec(), &mut again);
            decodes_again::<Command<'_>>(frame, &mut again);
        }
    }
}

/// Checks that the next whole frame after any bytes is decoded.
pub fn resynchronises(garbage: &[u8]) {
    let mut decoder = Decoder::new();
    for &byte in garbage {
        let _ = decoder.push(byte);
    }
    let mut frame = [0; MAX_FRAME];
    let frame = encode(9, &Command::ReadSettings, &mut frame).expect("it fits");
    let mut last = None;
    for &byte in frame {
        if let Some(Ok(frame)) = decoder.push(byte) {
            last = Some(decode::<Command<'_>>(frame) == Ok((9, Command::ReadSettings)));
        }
    }
    assert_eq!(last, Some(true));
}

/// Source of random choices from given bytes; zeros when they are used up.
struct Draw<'a>(&'a [u8]);

impl Draw<'_> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    fn below(&mut self, end: u8) -> u8 {
        self.byte() % end
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes([self.byte(), self.byte(), self.byte(), self.byte()])
    }

    fn bytes(&mut self) -> Vec<u8> {
        (0..self.byte()).map(|_| self.byte()).collect()
    }

    /// Settings mostly near the default and within bounds.
    fn settings(&mut self) -> Settings {
        let mut settings = Settings::default();
        for _ in 0..self.below(4) {
            let parameter = &PARAMETERS[usize::from(self.below(PARAMETERS.len() as u8))];
            let value = match self.below(4) {
                0 => parameter.min,
                1 => parameter.max,
                2 => self.word().cast_signed(),
                _ => settings.get(parameter.id).unwrap_or(0).wrapping_add(i32::from(self.byte())),
            };
            settings.set(parameter.id, Some(value));
        }
        settings
    }
}

/// A sensor, with a record of its settings.
struct Observer {
    sensor: PcSensor<Target>,
    /// Settings of each generation since the last start.
    names: HashMap<u32, Settings>,
    /// All settings that were ever active.
    active: Vec<Settings>,
    staged: u32,
    sequence: u16,
}

impl Observer {
    fn switch_on(store: RamNorFlash) -> Self {
        let pattern = ScanPattern::Grid(Grid { columns: 2, rows: 2, ..Grid::default() });
        let sensor = PcSensor::with_store(Target::default(), pattern, HARDWARE, store);
        Self {
            sensor,
            names: HashMap::new(),
            active: vec![Settings::default()],
            staged: 0,
            sequence: 0,
        }
    }

    /// Switches the power off and on; flash and record stay.
    fn restart(&mut self) {
        let mut store = self.sensor.store_mut().clone();
        store.switch_on();
        let active = std::mem::take(&mut self.active);
        *self = Self { active, ..Self::switch_on(store) };
    }

    fn hear(&mut self, bytes: &[u8]) {
        self.sensor.send(bytes);
        while self.sensor.receive(&mut [0; 256]) > 0 {}
        self.look();
    }

    fn say(&mut self, body: &impl Serialize) {
        self.sequence = self.sequence.wrapping_add(1);
        let mut frame = [0; MAX_FRAME];
        if let Ok(frame) = encode_for(Way::ToSensor, self.sequence, body, &mut frame) {
            self.hear(frame);
        }
    }

    fn look(&mut self) {
        let session = self.sensor.session();
        let (settings, (generation, hash)) = (*session.settings(), session.version());
        assert_eq!(settings.check(&HARDWARE), Ok(()));
        assert_eq!(hash, settings_hash(&settings));
        assert_eq!(
            *self.names.entry(generation).or_insert(settings),
            settings,
            "generation {generation}"
        );
        if !self.active.contains(&settings) {
            self.active.push(settings);
        }
        if let Some(saved) = load(self.sensor.store_mut(), &HARDWARE) {
            assert!(self.active.contains(&saved.settings), "saved settings were never active");
        }
    }

    fn command(&mut self, draw: &mut Draw<'_>) -> Command<'static> {
        let (generation, active) = self.sensor.session().version();
        let hash = match draw.below(4) {
            0 => active,
            1 => draw.word(),
            _ => self.staged,
        };
        let near = generation
            .wrapping_add(u32::from(draw.below(4)))
            .wrapping_sub(u32::from(draw.below(3)));
        match draw.below(11) {
            0 => Command::Hello(Greeting { protocol: draw.word() as u16, ..Greeting::OURS }),
            1 => {
                let settings = draw.settings();
                self.staged = settings_hash(&settings);
                Command::Stage(settings)
            }
            2 => Command::Commit {
                hash,
                base_generation: near,
                confirm_within: u16::from(draw.below(4)),
            },
            3 => Command::ReadSettings,
            4 => Command::ReadBeams {
                frame: draw.word() % 4,
                first: draw.word() % 6,
                count: u16::from(draw.below(6)),
            },
            5 => Command::ReadCounters,
            6 => Command::Confirm { generation: near },
            7 => Command::Save { hash },
            8 => Command::SetDeadline { scan_us: draw.word() },
            9 => Command::ReadTimes,
            _ => Command::Forget,
        }
    }
}

/// Sends one of the commands about waveforms; their codes repeat the bytes drawn.
fn say_of_waveforms(observer: &mut Observer, draw: &mut Draw<'_>) {
    let (frame, beam) = (draw.word() % 4, draw.word() % 6);
    match draw.below(4) {
        0 => observer.say(&Command::ReadRoom),
        1 => {
            let noise = Noise { scan: draw.word(), seed: draw.word().into() };
            let count = draw.below(6).into();
            observer.say(&Command::ReadNoisyBeams { frame, first: beam, count, noise });
        }
        _ => {
            let from = match draw.below(3) {
                0 => Place { beam, shot: draw.word() as u16, sample: draw.word() as u16 },
                _ => Place::of_beam(beam),
            };
            let seed = draw.bytes();
            let length = usize::from(draw.byte()) * 11;
            let packed: Vec<u8> = seed.into_iter().cycle().take(length.min(PACKED_BYTES)).collect();
            observer.say(&Command::Waveforms { frame, from, packed: &packed });
        }
    }
}

/// Runs a whole sensor through a program of at most 64 steps.
pub fn session(bytes: &[u8]) {
    let mut draw = Draw(bytes);
    let mut observer = Observer::switch_on(RamNorFlash::default());
    for _ in 0..64 {
        if draw.0.is_empty() {
            return;
        }
        match draw.below(16) {
            0..9 => {
                let command = observer.command(&mut draw);
                observer.say(&command);
            }
            9 => observer.say(&Command::Hello(Greeting::OURS)),
            10 => say_of_waveforms(&mut observer, &mut draw),
            11 => observer.hear(&draw.bytes()),
            12 => observer.say(&Raw(&draw.bytes())),
            13 => observer.sequence = draw.word() as u16,
            14 => observer
                .sensor
                .store_mut()
                .cut_after(usize::from(draw.below(40)), u64::from(draw.byte())),
            _ => observer.restart(),
        }
    }
}

/// Loads, saves and forgets in a flash of any contents; a first byte of 1 to 3 gives the first
/// slot, the second or both a right checksum.
pub fn store(bytes: &[u8]) {
    let (forged, rest) = bytes.split_first().map_or((0, bytes), |(first, rest)| (*first, rest));
    let mut image: Vec<u8> =
        rest.iter().copied().chain(std::iter::repeat(0xFF)).take(512).collect();
    image
        .chunks_mut(256)
        .enumerate()
        .filter(|(i, _)| forged < 4 && forged >> i & 1 == 1)
        .for_each(|(_, slot)| forge(slot));
    let mut flash = RamNorFlash::<4, 256>::from_bytes(image);
    let found = load(&mut flash, &HARDWARE);
    assert!(found.is_none_or(|saved| saved.settings.check(&HARDWARE).is_ok()));
    let new = Settings { gain_cdb: 123, ..Settings::default() };
    let revision = save(&mut flash, &HARDWARE, &new).expect("a flash that works");
    let expected = match found {
        None => 1,
        Some(saved) if saved.settings == new => saved.revision,
        Some(saved) => saved.revision.wrapping_add(1),
    };
    assert_eq!(revision, expected);
    assert_eq!(load(&mut flash, &HARDWARE).map(|saved| saved.settings), Some(new));
    forget(&mut flash, &HARDWARE).expect("a flash that works");
    assert_eq!(load(&mut flash, &HARDWARE), None);
}

/// Gives a slot the magic, the schema and a right checksum for its length.
fn forge(slot: &mut [u8]) {
    slot[..4].copy_from_slice(&MAGIC);
    slot[4..12].copy_from_slice(&SETTINGS_SCHEMA.to_le_bytes());
    slot[17..20].fill(0);
    let end = 20 + usize::from(slot[16] % 110);
    slot[16] = (end - 20) as u8;
    let sum = checksum(&slot[..end]);
    slot[end..end + 4].copy_from_slice(&sum.to_le_bytes());
}

/// Processes a waveform with the sensor's pipeline, a record with the echo finder, or a file of
/// records.
pub fn waveforms(bytes: &[u8]) {
    let mut draw = Draw(bytes);
    match draw.below(3) {
        0 => pipeline(&mut draw),
        1 => record(&mut draw),
        _ => file(draw.0),
    }
}

impl Draw<'_> {
    /// The rest of the bytes as codes, each repeated as often as the first byte says.
    fn codes(&mut self) -> Vec<u16> {
        let times = 1 + usize::from(self.below(16));
        let pairs = self.0.as_chunks::<2>().0.iter().map(|&pair| u16::from_le_bytes(pair));
        pairs.flat_map(|code| std::iter::repeat_n(code, times)).collect()
    }
}

fn pipeline(draw: &mut Draw<'_>) {
    let settings = draw.settings();
    let hardware = match draw.below(3) {
        0 => HARDWARE,
        1 => Hardware { adc_bits: u32::from(draw.below(18)), ..HARDWARE },
        _ => Hardware {
            adc_bits: 12,
            range_min_mm: draw.word(),
            range_max_mm: draw.word(),
            energy_limit_pj: draw.word(),
            unit_echo_milli: draw.word(),
            shot_noise_ppm: draw.word(),
        },
    };
    let Ok(pipeline) = Pipeline::new(&settings, &hardware) else { return };
    let codes = draw.codes();
    let echoes = pipeline.process(Portable, &codes, &mut Scratch::new());
    assert!(echoes.len() <= settings.echoes as usize);
    assert_eq!(pipeline.process(Scalar, &codes, &mut Scratch::new()), echoes);
}

fn record(draw: &mut Draw<'_>) {
    let mut finder = Box::new(EchoFinder::new());
    let code_shift = u32::from(draw.below(9));
    let (threshold, floor) = (draw.word(), draw.word());
    let (min_separation, echoes) = (u32::from(draw.byte()), usize::from(draw.below(40)));
    let outgoing: Vec<u16> = draw.bytes().into_iter().map(u16::from).collect();
    let pulse = Pulse::from_record(&mut finder, &outgoing, code_shift);
    let colour = (draw.below(2) == 0).then(|| Colour {
        ratio: 16 + draw.word() % 4_080,
        correlation: [0; LAGS].map(|_| draw.word() as i16),
    });
    let search = FinderConfig {
        code_shift,
        snr_threshold: threshold,
        floor,
        min_separation,
        echoes,
        pulse,
        colour,
        sigma: (draw.below(2) == 0).then(|| draw.word()),
        best_fit: draw.below(2) == 0,
    };
    let codes = draw.codes();
    let found = finder.echoes(&codes, &search);
    let end = (codes.len() as i64) << 16;
    assert!(found.len() <= echoes);
    let apart = i64::from(min_separation.max(1)) << 16;
    assert!(found.windows(2).all(|pair| pair[0].time + apart <= pair[1].time), "each echo once");

    assert!(
        found
            .iter()
            .all(|e| (0..end).contains(&e.time) && (0..end).contains(&e.top) && e.width >= 0)
    );
    assert_eq!(finder.echoes(&codes, &search), found, "used memory changes nothing");
}

fn file(bytes: &[u8]) {
    let Ok(rows) = parse_waveforms("any".as_ref(), bytes.to_vec(), &Selection::default()) else {
        return;
    };
    let rows: Vec<Vec<f64>> = (0..rows.len()).map(|row| rows.row(row).into_owned()).collect();
    let options =
        Options { sample_ns: 1.0, snr: 5.0, floor: 0.05, max_echoes: 100, min_separation_ns: 0.0 };
    for (waveform, row) in Finder::new(options).find(&rows, &rows).iter().zip(&rows) {
        let times: Vec<f64> = waveform.echoes.iter().map(|echo| echo.time_ns).collect();
        assert!(
            times.is_sorted_by(|a, b| a < b)
                && times.iter().all(|&t| t >= 0.0 && t < row.len() as f64)
        );
        let finite = |echo: &echoloop_instruments::Echo| {
            echo.amplitude.is_finite() && echo.width_ns.is_finite()
        };
        assert!(waveform.echoes.iter().all(finite));
    }
}
