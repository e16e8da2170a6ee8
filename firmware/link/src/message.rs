//! Messages between host and sensor.
//!
//! Bodies are postcard, which identifies fields and variants by their position: both are only ever
//! appended. Two builds with different [`SCHEMA`]s refuse each other at hello.

use echoloop_dsp::{Echoes, Hardware, PARAMETERS, Refusal, ScanPattern, Settings};
use heapless::{String, Vec};
use postcard_schema::Schema;
use postcard_schema::key::Key;
use serde::{Deserialize, Serialize};

use crate::frame::{Message, Way, checksum};

/// First bytes of a greeting.
pub const MAGIC: [u8; 4] = *b"ECHO";

/// Version of the conversation: the meaning of commands, beyond their bytes.
pub const PROTOCOL: u16 = 11;

/// Hash of the layout of all messages: FNV-1a over their names and types, computed at compile time.
pub const SCHEMA: u64 =
    u64::from_le_bytes(Key::for_path::<(Command<'static>, Report)>("echoloop/link").to_bytes());

/// Hash of the layout of [`Settings`] alone, computed as [`SCHEMA`]. Stored settings are read only
/// by firmware with the same layout.
pub const SETTINGS_SCHEMA: u64 =
    u64::from_le_bytes(Key::for_path::<Settings>("echoloop/settings").to_bytes());

/// Most beams of a [`Report::Beams`]: with four echoes each they fill a frame.
pub const BEAMS_PER_REPORT: usize = 32;

/// Most bytes of codes of a [`Command::Waveforms`]: after the longest numbers they fill a frame.
pub const PACKED_BYTES: usize = 2790;

/// Command from host to sensor. Every command is idempotent: sent twice, it is answered twice and
/// acts once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Command<'a> {
    /// Opens a session. Any other command before it is answered with [`Nack::NotReady`].
    Hello(Greeting),
    /// Checks a whole set of settings and stages it. Nothing changes yet.
    Stage(Settings),
    /// Makes the staged settings the active ones, at the next frame boundary.
    Commit {
        /// Hash from [`Report::Staged`].
        hash: u32,
        /// Generation that this commit follows: compare and swap.
        base_generation: u32,
        /// Number of frames within which a [`Command::Confirm`] has to come, or the settings before
        /// return; 0: no confirmation is needed.
        confirm_within: u16,
    },
    /// Asks for the active settings.
    ReadSettings,
    /// Measures beams `first..first + count` of scan `frame`, at most [`BEAMS_PER_REPORT`].
    ReadBeams {
        /// Number of the scan; a new number is a frame boundary.
        frame: u32,
        /// Index of the first beam.
        first: u32,
        /// Number of beams.
        count: u16,
    },
    /// Asks for the counters of the link.
    ReadCounters,
    /// Ends the trial of the active settings: they stay.
    Confirm {
        /// Generation of the settings.
        generation: u32,
    },
    /// Saves the active settings for the next start. Separate from commit, because flash wears.
    Save {
        /// Hash of the settings.
        hash: u32,
    },
    /// Erases the saved settings: the next start has the defaults.
    Forget,
    /// Asks for the room for [`Command::Waveforms`].
    ReadRoom,
    /// As [`Command::ReadBeams`], with the noise that a simulated front end adds.
    ReadNoisyBeams {
        /// Number of the scan; a new number is a frame boundary.
        frame: u32,
        /// Index of the first beam.
        first: u32,
        /// Number of beams.
        count: u16,
        /// Scan and seed that decide the noise.
        noise: Noise,
    },
    /// Part of the codes of scan `frame`, from a converter of the host. A scan is all its beams one
    /// after the other, a beam all its shots, a shot all its samples, those before the trigger
    /// first. Answered with [`Report::Beams`] for the beams whose last code is in this part.
    ///
    /// A part must continue where the one before it ended, else the answer is [`Nack::Awaited`]. A
    /// part that begins with a beam is always accepted, and restarts that beam.
    Waveforms {
        /// Number of the scan; a new number is a frame boundary.
        frame: u32,
        /// Place of the first code.
        from: Place,
        /// Codes, [`crate::packed`] at the converter's bits.
        #[serde(borrow)]
        packed: &'a [u8],
    },
    /// Sets the deadline of a scan and restarts the counts; answered with [`Report::Times`].
    SetDeadline {
        /// Longest time that the sensor may be busy for a scan, µs; 0: no limit.
        scan_us: u32,
    },
    /// Asks for the times that scans have taken.
    ReadTimes,
}

impl Message for Command<'_> {
    const WAY: Way = Way::ToSensor;
}

/// Scan number and seed that, beside beam and shot, decide the noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Noise {
    /// Number of the scan for the noise, such as first or second of a pair, where it differs from
    /// the number that selects the viewpoint.
    pub scan: u32,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Place of a code within a scan.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Schema,
)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Place {
    /// Index of the beam.
    pub beam: u32,
    /// Index of this shot among the shots added up for the beam, from 0.
    pub shot: u16,
    /// Index of the sample, counted from the first before the trigger.
    pub sample: u16,
}

impl Place {
    /// Place at which a beam begins.
    pub const fn of_beam(beam: u32) -> Self {
        Self { beam, shot: 0, sample: 0 }
    }

    /// True when a beam begins at this place.
    pub fn begins_beam(&self) -> bool {
        (self.shot, self.sample) == (0, 0)
    }
}

/// Report from sensor to host: the answer to the command of the same sequence number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(
    clippy::large_enum_variant,
    reason = "lives for one frame, and there is no heap to box it on"
)]
pub enum Report {
    /// Greeting and description of the sensor.
    Hello {
        /// Magic, protocol and schema of the sensor.
        greeting: Greeting,
        /// Name and version of the firmware.
        build: String<32>,
        /// Constants of the hardware.
        hardware: Hardware,
        /// Scan pattern; the settings may aim one that is steered.
        pattern: ScanPattern,
    },
    /// The command was understood but not carried out.
    Nack(Nack),
    /// The settings were refused; the old ones stay.
    Refused(Refusal),
    /// The settings are staged.
    Staged {
        /// Hash of the settings, which commits them.
        hash: u32,
    },
    /// The settings are active, now or from the next frame on.
    Committed {
        /// Generation of the settings.
        generation: u32,
        /// Hash of the settings.
        hash: u32,
    },
    /// The active settings.
    Settings {
        /// Generation of the settings.
        generation: u32,
        /// Hash of the settings.
        hash: u32,
        /// The settings.
        settings: Settings,
    },
    /// Echoes of consecutive beams.
    Beams {
        /// Number of the scan.
        frame: u32,
        /// Index of the first beam.
        first: u32,
        /// Generation of the settings that the beams were measured with.
        generation: u32,
        /// Hash of those settings.
        hash: u32,
        /// Echoes of each beam.
        beams: Vec<Echoes, BEAMS_PER_REPORT>,
    },
    /// Counters of the link.
    Counters(Counters),
    /// The active settings stay.
    Confirmed {
        /// Generation of the settings.
        generation: u32,
    },
    /// The active settings are saved for the next start.
    Saved {
        /// Hash of the settings.
        hash: u32,
        /// Number of saves since the store was last empty, modulo 2³².
        revision: u32,
    },
    /// Nothing is saved.
    Forgotten,
    /// Room for [`Command::Waveforms`].
    Room(Room),
    /// Times that scans have taken.
    Times(Times),
}

impl Message for Report {
    const WAY: Way = Way::ToHost;
}

/// Times that whole scans have taken since the deadline was set, or since the sensor started.
///
/// The time of a scan is the time that the sensor was busy with it: for each command that asks for
/// beams or brings waveforms, from decoding the command to the last byte of its answer. The host's
/// time between commands is not part of it; a repeated command counts again. A scan counts once all
/// its beams have been measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Times {
    /// True when the board has a clock; without one nothing is timed.
    pub clock: bool,
    /// Deadline as set, µs; 0: none.
    pub deadline_us: u32,
    /// Number of scans that were timed.
    pub scans: u32,
    /// Number of scans that took longer than the deadline.
    pub late: u32,
    /// Time of the newest scan, µs.
    pub last_us: u32,
    /// Time of the slowest scan, µs.
    pub longest_us: u32,
}

/// Room of a sensor for waveforms that come over the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Room {
    /// Most codes of a shot.
    pub codes: u32,
    /// Most frames under way without an answer: the one being worked on, and those that the link
    /// holds meanwhile.
    pub frames: u16,
}

/// Greeting: identifies Echoloop, its protocol and its schema. Its layout never changes: magic,
/// then protocol and schema in fixed little endian.
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
    /// Greeting of this build.
    pub const OURS: Self = Self { magic: MAGIC, protocol: PROTOCOL, schema: SCHEMA };

    /// Reads the greeting at the head of the answer to a hello, whatever the schema of the rest.
    /// `None` when the body is no such answer.
    pub fn from_answer(body: &[u8]) -> Option<Self> {
        const HELLO: u8 = 0;
        let rest = body.split_first().filter(|(variant, _)| **variant == HELLO)?.1;
        let (greeting, _) = postcard::take_from_bytes::<Self>(rest).ok()?;
        (greeting.magic == MAGIC).then_some(greeting)
    }
}

/// Reason why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Nack {
    /// No matching hello has come.
    NotReady,
    /// The frame's checksum is right but its body is no command of this schema.
    Unintelligible,
    /// The commit names another hash than the staged one.
    NotStaged {
        /// Hash of the staged settings; 0: nothing is staged.
        staged: u32,
    },
    /// The commit follows another generation than the newest, or the confirmation names another
    /// than the active one.
    WrongGeneration {
        /// Newest or active generation.
        generation: u32,
    },
    /// The beams asked for do not exist or are too many for one report.
    NoSuchBeams {
        /// Number of beams of a scan.
        beams: u32,
    },
    /// The front end did not answer on its bus.
    FrontEnd,
    /// The save names other settings than the active ones.
    NotActive {
        /// Hash of the active settings.
        hash: u32,
    },
    /// The settings to be saved are on trial.
    OnTrial,
    /// The settings could not be stored; those saved before are still there.
    Storage,
    /// The hello is numbered just before the newest command, as if other commands had overtaken it.
    /// A new session must begin with a number after the newest.
    Overtaken {
        /// Number of the newest command.
        newest: u16,
    },
    /// The codes do not continue those before them: some were lost, or came twice.
    Awaited {
        /// Place at which the sensor goes on; it also accepts the beginning of any beam.
        place: Place,
    },
}

/// Counters of link and sensor since the sensor started.
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
    /// Starts since power came on, except the first: by the watchdog.
    pub restarts: u32,
    /// Whole frames that go to the host: the line returned the sensor's own.
    pub echoes: u32,
}

/// Hash of settings, the CRC-32C of their postcard bytes, by which commits and scans name them.
/// Never 0.
pub fn settings_hash(settings: &Settings) -> u32 {
    let mut bytes = [0; 6 * PARAMETERS.len()]; // 5 bytes a field, and 1 where it is an option
    let bytes = postcard::to_slice(settings, &mut bytes).map_or(&[][..], |bytes| bytes);
    checksum(bytes).max(1)
}
