//! Waveforms sent to the board over its link, and the PC's echoes for them.

use echoloop_dsp::accumulate::Accumulator;
use echoloop_dsp::{Echoes, Hardware, Pipeline, Scratch, Settings};
use echoloop_link::packed::{codes_in, pack};
use echoloop_link::{Command, Greeting, MAX_FRAME, PACKED_BYTES, Place, Report, Room, encode};
use echoloop_sensors::boards::qemu::Qemu;
use echoloop_sensors::transport::Transport;
use echoloop_tests::faults::Target;
use echoloop_tests::vectors::{self, KINDS};

use crate::board::answers;

/// A board that receives its waveforms over the link.
pub(crate) struct Fed {
    pub(crate) board: Qemu<Target>,
    sequence: u16,
    scan: u32,
}

impl Fed {
    pub(crate) fn of(board: Qemu<Target>) -> Self {
        let mut fed = Self { board, sequence: 0, scan: 0 };
        let hello = fed.ask(&[Command::Hello(Greeting::OURS)]);
        assert!(matches!(hello[..], [Report::Hello { .. }]), "{hello:?}");
        let room = fed.ask(&[Command::ReadRoom]);
        let [Report::Room(Room { frames, .. })] = room[..] else { panic!("{room:?}") };
        assert_eq!(usize::from(frames), UNDER_WAY);
        fed
    }

    /// Answers to commands that are sent in one go.
    pub(crate) fn ask(&mut self, commands: &[Command<'_>]) -> Vec<Report> {
        let first = self.sequence;
        for command in commands {
            let mut frame = [0; MAX_FRAME];
            self.board.send(encode(self.sequence, command, &mut frame).unwrap()).unwrap();
            self.sequence += 1;
        }
        let found = answers(&mut self.board, commands.len());
        assert!(found.iter().map(|(number, _)| *number).eq(first..self.sequence), "{found:?}");
        found.into_iter().map(|(_, report)| report).collect()
    }

    pub(crate) fn configure(&mut self, settings: &Settings) {
        let staged = self.ask(&[Command::Stage(*settings)]);
        let [Report::Staged { hash }] = staged[..] else { panic!("{staged:?}") };
        let base_generation = self.scan;
        let committed = self.ask(&[Command::Commit { hash, base_generation, confirm_within: 0 }]);
        assert!(matches!(committed[..], [Report::Committed { .. }]), "{committed:?}");
        self.scan += 1;
    }

    /// Echoes of waveforms, each sent `shots` times.
    pub(crate) fn echoes(&mut self, waves: &[Vec<u16>], shots: usize) -> Vec<Echoes> {
        let samples = waves[0].len();
        let row: Vec<u16> = waves.iter().flat_map(|wave| wave.repeat(shots)).collect();
        let place = |at: usize| Place {
            beam: (at / (samples * shots)) as u32,
            shot: (at / samples % shots) as u16,
            sample: (at % samples) as u16,
        };
        let each = codes_in(PACKED_BYTES, ADC_BITS);
        let parts: Vec<(Place, Vec<u8>)> = row
            .chunks(each)
            .enumerate()
            .map(|(i, codes)| {
                let mut packed = vec![0; PACKED_BYTES];
                let length = pack(codes, ADC_BITS, &mut packed).unwrap();
                packed.truncate(length);
                (place(i * each), packed)
            })
            .collect();
        let frame = self.scan;
        let mut found = Vec::new();
        for together in parts.chunks(UNDER_WAY) {
            let commands: Vec<Command<'_>> = together
                .iter()
                .map(|(from, packed)| Command::Waveforms { frame, from: *from, packed })
                .collect();
            for report in self.ask(&commands) {
                let Report::Beams { beams, .. } = report else { panic!("{report:?}") };
                found.extend(beams);
            }
        }
        found
    }
}

/// Number of frames that the board accepts at once.
pub(crate) const UNDER_WAY: usize = 2;
/// Bits of the converter that it reports.
pub(crate) const ADC_BITS: u32 = Hardware::REFERENCE.adc_bits;
/// Number of waveforms per case, every kind twice.
pub(crate) const BEAMS: usize = 32;

/// Draws settings and waveforms; short ones, because the emulator's line is slow.
pub(crate) fn case(seed: u64) -> (Settings, Vec<Vec<u16>>) {
    let hardware = Hardware::REFERENCE;
    let mut rng = vectors::rng(seed);
    let settings = loop {
        let drawn = vectors::settings(&mut rng, &hardware);
        let shorter = Settings { bins: 100 + drawn.bins % 150, shots: drawn.shots.min(2), ..drawn };
        if shorter.check(&hardware).is_ok() {
            break shorter;
        }
    };
    let kinds = KINDS.iter().cycle().take(BEAMS);
    let waves = kinds.map(|&kind| {
        let mut wave = vectors::waveform(&settings, &hardware, kind, &mut rng);
        // The link carries only the codes of a converter.
        wave.iter_mut().for_each(|code| *code = (*code).min((1 << ADC_BITS) - 1));
        wave.resize((settings.pre_trigger_samples() + settings.bins as u32) as usize, 0);
        wave
    });
    (settings, waves.collect())
}

/// Echoes found on the PC.
pub(crate) fn on_the_pc(settings: &Settings, waves: &[Vec<u16>]) -> Vec<Echoes> {
    let pipeline = Pipeline::new(settings, &Hardware::REFERENCE).unwrap();
    let mut scratch = Scratch::new();
    let config = pipeline.config();
    let find = |wave: &Vec<u16>| {
        let mut codes = wave.clone();
        if config.shots > 1 {
            let mut sum = Accumulator::new();
            (0..config.shots).for_each(|shot| sum.add(shot, wave));
            sum.read(config.sum_shift, &mut codes);
        }
        echoloop_kernels::process_baseline(&pipeline, &codes, &mut scratch)
    };
    waves.iter().map(find).collect()
}
