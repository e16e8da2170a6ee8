//! The example of the detector alone (`examples/detector_firmware`), built without the detector's
//! default features, on three processors in QEMU. A debugger takes the place of DMA.
//!
//! `cargo xtask firmware` builds it.

use echoloop_dsp::{
    Echo, Echoes, Flags, Hardware, MAX_ECHOES, Pipeline, ScanPattern, Scratch, Settings,
};
use echoloop_kernels::process_baseline;
use echoloop_sensors::boards::qemu::{Machine, Qemu};
use echoloop_tests::faults::Target;
use echoloop_tests::gdb::Gdb;
use echoloop_tests::target::{machine_with, symbol};
use echoloop_tests::vectors::{self, KINDS};

/// Cortex-M4F, RV32IMAC, and an M3 that runs the build for the M0.
const MACHINES: [Machine; 3] = [Machine::An386, Machine::Virt, Machine::An385];

/// Codes of a shot, as in the example.
const SAMPLES: usize = 800;

/// The example's settings.
fn settings() -> Settings {
    Settings { bins: SAMPLES as i32, echoes: MAX_ECHOES as i32, ..Settings::default() }
}

/// Waveforms of every kind, several of each.
fn waveforms() -> Vec<Vec<u16>> {
    let mut rng = vectors::rng(19);
    let kinds = KINDS.iter().cycle().take(4 * KINDS.len());
    let waves = kinds.map(|&kind| {
        let mut wave = vectors::waveform(&settings(), &Hardware::REFERENCE, kind, &mut rng);
        wave.resize(SAMPLES, 0); // the buffer is always full
        wave
    });
    waves.collect()
}

/// Addresses of the example's variables.
struct Places {
    codes: u32,
    full: u32,
    words: u32,
    count: u32,
    shots: u32,
}

/// Passes a waveform to the example and reads its echoes; `shots` is the number of earlier ones.
fn answer(gdb: &mut Gdb, places: &Places, wave: &[u16], shots: u32) -> Echoes {
    let codes: Vec<u8> = wave.iter().flat_map(|code| code.to_le_bytes()).collect();
    gdb.write(places.codes, &codes).unwrap();
    gdb.write(places.full, &[1]).unwrap();
    gdb.run_to_write(places.shots).unwrap();
    let words = |gdb: &mut Gdb, at, count: usize| -> Vec<u32> {
        let bytes = gdb.read(at, 4 * count).unwrap();
        bytes.chunks(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect()
    };
    assert_eq!(words(gdb, places.shots, 1), [shots + 1]);
    let count = words(gdb, places.count, 1)[0] as usize;
    words(gdb, places.words, 4 * count).chunks(4).map(echo).collect()
}

/// An echo from its four words.
fn echo(words: &[u32]) -> Echo {
    let [high, low] = [|word: u32| (word >> 16) as u16, |word: u32| word as u16];
    Echo {
        range: words[0],
        amplitude: high(words[1]),
        width: low(words[1]),
        snr: high(words[2]),
        deviation: low(words[2]),
        reflectivity: high(words[3]),
        flags: Flags(low(words[3]) as u8),
    }
}

#[test]
fn the_detector_alone_finds_the_same_echoes_on_three_processors_as_on_the_pc() {
    let waves = waveforms();
    let pipeline = Pipeline::new(&settings(), &Hardware::REFERENCE).unwrap();
    let mut scratch = Scratch::new();
    for kind in MACHINES {
        let Some(mut options) = machine_with(kind, "detector-firmware") else { continue };
        let folder = tempfile::tempdir().unwrap();
        options.folder = Some(folder.path().to_owned());
        let socket = folder.path().join("gdb");
        options.arguments = Gdb::arguments(&socket).into();
        options.arguments.push("-S".into()); // stopped before its first instruction
        let (pattern, hardware) = (ScanPattern::default(), Hardware::REFERENCE);
        let _board = Qemu::start(&options, Target::default(), pattern, hardware).unwrap();
        let mut gdb = Gdb::connect(&socket).unwrap();
        // At main, the start-up code has set memory to zero.
        gdb.run_to(symbol(&options, "main") & !1, || {}).unwrap();
        let places = Places {
            codes: symbol(&options, "ADC_CODES"),
            full: symbol(&options, "ADC_FULL"),
            words: symbol(&options, "ECHO_WORDS"),
            count: symbol(&options, "ECHO_COUNT"),
            shots: symbol(&options, "SHOTS"),
        };
        let mut found = 0;
        for (shots, wave) in (0..).zip(&waves) {
            let on_pc = process_baseline(&pipeline, wave, &mut scratch);
            let on_board = answer(&mut gdb, &places, wave, shots);
            assert_eq!(on_board, on_pc, "{}, waveform {shots}", kind.name());
            found += on_pc.len();
        }
        println!("{}: {} waveforms, {found} echoes", kind.name(), waves.len());
        assert!(found > waves.len() / 2, "{found} echoes compare little");
    }
}
