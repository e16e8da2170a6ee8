//! What host and sensor say to each other.
//!
//! Bodies are postcard, so positions are the format: variants and fields are only ever appended,
//! and [`SCHEMA`] makes two builds that disagree refuse each other at hello.

use echoloop_dsp::{Echoes, Hardware, PARAMETERS, Refusal, ScanPattern, Settings};
use heapless::{String, Vec};
use postcard_schema::Schema;
use postcard_schema::key::Key;
use serde::{Deserialize, Serialize};

use crate::frame::{Message, Way, checksum};

/// First bytes of every greeting.
pub const MAGIC: [u8; 4] = *b"ECHO";

/// Version of the conversation: what commands mean, beyond their bytes.
pub const PROTOCOL: u16 = 10;

/// Hash of the bytes' layout: FNV-1a over names and types of every message, computed when compiled.
pub const SCHEMA: u64 =
    u64::from_le_bytes(Key::for_path::<(Command<'static>, Report)>("echoloop/link").to_bytes());

/// Hash of the layout of [`Settings`] alone, as [`SCHEMA`]: what is stored is only read by firmware
/// that lays it out the same.
pub const SETTINGS_SCHEMA: u64 =
    u64::from_le_bytes(Key::for_path::<Settings>("echoloop/settings").to_bytes());

/// Beams a [`Report::Beams`] holds at most: with four echoes each they fill a frame.
pub const BEAMS_PER_REPORT: usize = 32;

/// Bytes of codes that a [`Command::Waveforms`] holds at most: with the widest numbers before them
/// they fill a frame.
pub const PACKED_BYTES: usize = 2790;

/// From host to sensor. Every command is idempotent: said twice, it answers twice and acts once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Command<'a> {
    /// Opens a session. Everything else before it is answered with [`Nack::NotReady`].
    Hello(Greeting),
    /// Checks a whole set of settings and holds it ready. Nothing changes yet.
    Stage(Settings),
    /// Makes the staged settings the active ones, at the next frame boundary.
    Commit {
        /// What [`Report::Staged`] answered.
        hash: u32,
        /// The generation this one follows: compare and swap.
        base_generation: u32,
        /// Frames within which a [`Command::Confirm`] has to come, or the settings before it
        /// return; 0: none has to.
        confirm_within: u16,
    },
    /// Asks for the active settings.
    ReadSettings,
    /// Measures beams `first..first + count` of scan `frame`, at most [`BEAMS_PER_REPORT`].
    ReadBeams {
        /// Number of the scan; a new number is a frame boundary.
        frame: u32,
        /// First beam.
        first: u32,
        /// How many.
        count: u16,
    },
    /// Asks how the link has been.
    ReadCounters,
    /// Ends the trial of the active settings: they stay.
    Confirm {
        /// Their generation.
        generation: u32,
    },
    /// Makes the active settings those of the next start. Apart from commit, because flash wears.
    Save {
        /// Their hash.
        hash: u32,
    },
    /// Drops what is saved: the next start has the defaults.
    Forget,
    /// Asks what room there is for [`Command::Waveforms`].
    ReadRoom,
    /// As [`Command::ReadBeams`], and says what noise a front end that is simulated adds.
    ReadNoisyBeams {
        /// Number of the scan; a new number is a frame boundary.
        frame: u32,
        /// First beam.
        first: u32,
        /// How many.
        count: u16,
        /// What decides the noise.
        noise: Noise,
    },
    /// Codes of a converter that the host has: a part of scan `frame`, which is all its beams one
    /// after the other, of each all its shots, of each all its samples, those before the trigger
    /// first. Answered with [`Report::Beams`], of the beams whose last code is among them.
    ///
    /// A part goes on where the one before it ended, else it is a [`Nack::Awaited`]; but one that
    /// begins with a beam is always taken, and that beam is begun anew.
    Waveforms {
        /// Number of the scan; a new number is a frame boundary.
        frame: u32,
        /// Of the first code.
        from: Place,
        /// The codes, [`crate::packed`] at the converter's bits.
        #[serde(borrow)]
        packed: &'a [u8],
    },
    /// Says how long a scan may take, and begins to count anew; answered with [`Report::Times`].
    SetDeadline {
        /// As long may the sensor be busy for a scan, µs; 0: as long as it likes.
        scan_us: u32,
    },
    /// Asks how long scans have taken.
    ReadTimes,
}

impl Message for Command<'_> {
    const WAY: Way = Way::ToSensor;
}

/// What decides the noise of a scan, beside beam and shot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Noise {
    /// Which scan it is, where that is not the number that the sensor's viewpoint goes by: the
    /// first or the second of a pair.
    pub scan: u32,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Where in a scan a code lies.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Schema,
)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Place {
    /// The beam.
    pub beam: u32,
    /// Of the shots that are added up for the beam, the how manieth, from 0.
    pub shot: u16,
    /// The sample, counted from the first before the trigger.
    pub sample: u16,
}

impl Place {
    /// Where a beam begins.
    pub const fn of_beam(beam: u32) -> Self {
        Self { beam, shot: 0, sample: 0 }
    }

    /// Whether a beam begins there.
    pub fn begins_beam(&self) -> bool {
        (self.shot, self.sample) == (0, 0)
    }
}

/// From sensor to host: the answer to the command of the same sequence number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(
    clippy::large_enum_variant,
    reason = "lives for one frame, and there is no heap to box it on"
)]
pub enum Report {
    /// The sensor's greeting, and what it is.
    Hello {
        /// Its magic, protocol and schema.
        greeting: Greeting,
        /// Name and version of the firmware.
        build: String<32>,
        /// What its hardware fixes.
        hardware: Hardware,
        /// Where its beams point.
        pattern: ScanPattern,
    },
    /// The command was understood and not carried out.
    Nack(Nack),
    /// The settings were not taken; the old ones stay.
    Refused(Refusal),
    /// The settings are held ready.
    Staged {
        /// Their hash, which commits them.
        hash: u32,
    },
    /// The settings are active, or will be from the next frame on.
    Committed {
        /// Their generation.
        generation: u32,
        /// Their hash.
        hash: u32,
    },
    /// The active settings.
    Settings {
        /// Their generation.
        generation: u32,
        /// Their hash.
        hash: u32,
        /// Themselves.
        settings: Settings,
    },
    /// Echoes of consecutive beams.
    Beams {
        /// Number of the scan.
        frame: u32,
        /// The first beam.
        first: u32,
        /// Generation of the settings that made them.
        generation: u32,
        /// Hash of those settings.
        hash: u32,
        /// The echoes, beam by beam.
        beams: Vec<Echoes, BEAMS_PER_REPORT>,
    },
    /// How the link has been.
    Counters(Counters),
    /// The active settings stay.
    Confirmed {
        /// Their generation.
        generation: u32,
    },
    /// The active settings are those of the next start.
    Saved {
        /// Their hash.
        hash: u32,
        /// How many sets have been saved since there were none, modulo 2³².
        revision: u32,
    },
    /// Nothing is saved.
    Forgotten,
    /// The room for [`Command::Waveforms`].
    Room(Room),
    /// How long scans have taken.
    Times(Times),
}

impl Message for Report {
    const WAY: Way = Way::ToHost;
}

/// How long whole scans have taken the sensor since its deadline was set, or since it started.
///
/// The time of a scan is what the sensor was busy for it: for each command that asks for beams or
/// brings waveforms, from when it was understood to the last byte of its answer. What the host
/// takes in between is not part of it; what it asks for twice counts twice. A scan of which beams
/// were never asked for is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Times {
    /// Whether the board has a clock; without one nothing is timed.
    pub clock: bool,
    /// As set, µs; 0: none.
    pub deadline_us: u32,
    /// Scans that were timed.
    pub scans: u32,
    /// Those that took longer than the deadline.
    pub late: u32,
    /// Time of the newest, µs.
    pub last_us: u32,
    /// Time of the slowest, µs.
    pub longest_us: u32,
}

/// What room a sensor has for waveforms that come over the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Room {
    /// Codes that a shot may have.
    pub codes: u32,
    /// Frames that may be under way without an answer: the one that is worked on, and those that
    /// the link holds meanwhile.
    pub frames: u16,
}

/// Who speaks, and which language. Its bytes never change: magic, then protocol and schema in fixed
/// little endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Greeting {
    /// [`MAGIC`].
    pub magic: [u8; 4],
    /// [`PROTOCOL`].
    #[serde(with = "postcard::fixint::le")]
    pub protocol: u16,
    /// [`SCHEMA`].
    #[serde(with = "postcard::fixint::le")]
    pub schema: u64,
}

impl Greeting {
    /// This build's.
    pub const OURS: Self = Self { magic: MAGIC, protocol: PROTOCOL, schema: SCHEMA };

    /// The greeting at the head of a hello's answer, of whatever schema the rest is. `None`: the
    /// body is no such answer.
    pub fn from_answer(body: &[u8]) -> Option<Self> {
        const HELLO: u8 = 0;
        let rest = body.split_first().filter(|(variant, _)| **variant == HELLO)?.1;
        let (greeting, _) = postcard::take_from_bytes::<Self>(rest).ok()?;
        (greeting.magic == MAGIC).then_some(greeting)
    }
}

/// Why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Nack {
    /// No matching hello has been said.
    NotReady,
    /// The frame's checksum held but its body is no command of this schema.
    Unintelligible,
    /// Commit of a hash other than the staged one (0: nothing is staged).
    NotStaged {
        /// Hash of what is staged.
        staged: u32,
    },
    /// Commit on top of a generation other than the newest, or confirmation of one other than the
    /// active.
    WrongGeneration {
        /// That one.
        generation: u32,
    },
    /// The beams asked for do not exist or are too many for one report.
    NoSuchBeams {
        /// Beams of a scan.
        beams: u32,
    },
    /// The front end did not answer on its bus.
    FrontEnd,
    /// Save of settings other than the active ones.
    NotActive {
        /// Hash of the active ones.
        hash: u32,
    },
    /// Save of settings that are on trial.
    OnTrial,
    /// The settings could not be stored; what was saved before still is.
    Storage,
    /// Hello that was numbered just behind the newest command, as one that other commands have
    /// overtaken is. A new session begins with a number after it.
    Overtaken {
        /// Of the newest command.
        newest: u16,
    },
    /// Codes that do not follow those before them: some were lost, or have been taken.
    Awaited {
        /// Where the sensor goes on; it begins any beam anew, too.
        place: Place,
    },
}

/// How the link and the sensor have been since the sensor started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Frames that arrived whole.
    pub frames: u32,
    /// Frames whose checksum failed.
    pub crc_failures: u32,
    /// Frames that were not COBS.
    pub cobs_failures: u32,
    /// Frames too long to hold.
    pub overflows: u32,
    /// Frames whose body was no command.
    pub unintelligible: u32,
    /// Settings refused.
    pub refusals: u32,
    /// Commands older than one already taken, or of another session.
    pub stale: u32,
    /// Trials that ended with the settings before them.
    pub rollbacks: u32,
    /// Starts since power came on, but for the first: by the watchdog.
    pub restarts: u32,
    /// Whole frames that go to the host: the line gives the sensor its own back.
    pub echoes: u32,
}

/// CRC-32C of the settings' postcard bytes: what a commit and every scan name them by. Never 0.
pub fn settings_hash(settings: &Settings) -> u32 {
    let mut bytes = [0; 6 * PARAMETERS.len()]; // 5 bytes a field, and 1 where it is an option
    let bytes = postcard::to_slice(settings, &mut bytes).map_or(&[][..], |bytes| bytes);
    checksum(bytes).max(1)
}
