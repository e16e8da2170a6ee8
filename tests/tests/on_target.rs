//! The image on boards in QEMU: the same bytes as in process, and a sensor that comes back from whatever happens to it.
//!
//! `cargo xtask firmware` builds the images. `ECHOLOOP_WAVEFORMS=100000` lengthens the comparison.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::time::Duration;

use echoloop_dsp::{Echoes, Hardware, Pipeline, ScanPattern, Scratch, Settings};
use echoloop_host::client::{Client, Patience};
use echoloop_host::transport::{InProcess, Transport};
use echoloop_sim::board::{Analog, FrontEnd, PcSensor};
use echoloop_sim::qemu::{Machine, Qemu, QemuOptions};
use echoloop_sim::vector::process_baseline;
use echoloop_tests::gdb::Gdb;
use echoloop_tests::target::{machine, machines};
use echoloop_tests::vectors::{self, KINDS};
use object::{Object, ObjectSymbol};

/// As many beams as one report holds.
const PATTERN: ScanPattern = ScanPattern { columns: 8, rows: 4, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 };
const BEAMS: usize = 32;

/// An emulator may be kept waiting by everything else that the machine does.
const PATIENCE: Patience = Patience { timeout: Duration::from_secs(5), tries: 4 };

/// A front end that gives each beam its waveform.
#[derive(Clone, Default)]
struct Waveforms {
    adc_bits: u32,
    beams: Vec<Vec<u16>>,
}

impl FrontEnd for Waveforms {
    fn adc_bits(&self) -> u32 {
        self.adc_bits
    }

    fn capture(&mut self, _: &Analog, _frame: u32, beam: u32, codes: &mut [u16]) {
        codes.fill(0);
        if let Some(wave) = self.beams.get(beam as usize) {
            let length = wave.len().min(codes.len());
            codes[..length].copy_from_slice(&wave[..length]);
        }
    }
}

fn start(options: &QemuOptions, hardware: Hardware) -> Client<Qemu<Waveforms>> {
    let front_end = Waveforms { adc_bits: hardware.adc_bits, ..Waveforms::default() };
    let qemu = Qemu::start(options, front_end, PATTERN, hardware).unwrap();
    Client::connect_from(qemu, PATIENCE, 0).unwrap()
}

/// Settings, and a waveform for each beam: every kind twice.
fn case(seed: u64, hardware: &Hardware) -> (Settings, Vec<Vec<u16>>) {
    let mut rng = vectors::rng(seed);
    let settings = vectors::settings(&mut rng, hardware);
    let kinds = KINDS.iter().cycle().take(BEAMS);
    let beams = kinds.map(|&kind| {
        let mut wave = vectors::waveform(&settings, hardware, kind, &mut rng);
        wave.resize(settings.bins as usize, 0); // a front end gives all samples
        wave
    });
    (settings, beams.collect())
}

/// What a sensor says of a case.
fn measure<T: Transport>(client: &mut Client<T>, settings: &Settings) -> Vec<Echoes> {
    client.configure(settings).unwrap();
    client.scan(1).unwrap()
}

#[test]
fn every_board_says_of_every_waveform_what_the_pc_says() {
    let waveforms: usize = std::env::var("ECHOLOOP_WAVEFORMS").map_or(2_048, |text| text.parse().unwrap());
    let sensors = [Hardware::REFERENCE, Hardware { adc_bits: 14, range_min_mm: 0, ..Hardware::REFERENCE }];
    for options in machines() {
        let mut echoes = 0;
        for (hardware, first) in sensors.into_iter().zip([0, 1_000_000]) {
            let front_end = Waveforms { adc_bits: hardware.adc_bits, ..Waveforms::default() };
            let mut pc =
                Client::connect(InProcess(PcSensor::new(front_end, PATTERN, hardware)), Patience::default()).unwrap();
            let mut board = start(&options, hardware);
            let mut scratch = Scratch::new();
            for seed in first..first + waveforms.div_ceil(sensors.len() * BEAMS) as u64 {
                let (settings, beams) = case(seed, &hardware);
                pc.transport_mut().0.front_end_mut().beams.clone_from(&beams);
                board.transport_mut().front_end_mut().beams.clone_from(&beams);
                let vectorised = measure(&mut pc, &settings);
                let on_board = measure(&mut board, &settings);
                assert_eq!(on_board, vectorised, "{}, seed {seed}: {settings:?}", options.machine.name());
                let pipeline = Pipeline::new(&settings, &hardware).unwrap();
                let scalar: Vec<Echoes> = beams.iter().map(|w| process_baseline(&pipeline, w, &mut scratch)).collect();
                assert_eq!(scalar, vectorised, "seed {seed}: {settings:?}");
                echoes += scalar.iter().map(|e| e.len()).sum::<usize>();
            }
        }
        println!("{}: {waveforms} waveforms, {echoes} echoes", options.machine.name());
        assert!(echoes > waveforms / 4, "{echoes} echoes of {waveforms} waveforms compare little");
    }
}

/// Address of a symbol of the image.
fn symbol(options: &QemuOptions, name: &str) -> u32 {
    let elf = fs::read(&options.image).unwrap();
    let file = object::File::parse(&*elf).unwrap();
    file.symbols().find(|s| s.name() == Ok(name)).unwrap_or_else(|| panic!("no {name}")).address() as u32
}

#[test]
fn the_stack_stays_within_the_bound_that_the_image_is_built_with() {
    const PAINT: u8 = 0xA5;
    for kind in [Machine::An386, Machine::An505] {
        let Some(mut options) = machine(kind) else { continue };
        let folder = tempfile::tempdir().unwrap();
        options.folder = Some(folder.path().to_owned());
        let socket = folder.path().join("gdb");
        options.arguments = Gdb::arguments(&socket).into();
        options.arguments.push("-S".into()); // stopped before its first instruction
        let painted = 64 << 10;
        let top = symbol(&options, "_stack_start");
        let qemu =
            Qemu::start(&options, Waveforms { adc_bits: 12, ..Waveforms::default() }, PATTERN, Hardware::REFERENCE);
        let mut gdb = Gdb::connect(&socket).unwrap();
        gdb.fill(top - painted, painted as usize, PAINT).unwrap();
        gdb.detach().unwrap();
        let mut client = Client::connect(qemu.unwrap(), PATIENCE).unwrap();
        for seed in 0..8 {
            let (settings, beams) = case(seed, &Hardware::REFERENCE);
            client.transport_mut().front_end_mut().beams = beams;
            measure(&mut client, &settings);
        }
        client.read_counters().unwrap();
        let memory = Gdb::connect(&socket).unwrap().read(top - painted, painted as usize).unwrap();
        let used = memory.len() - memory.iter().position(|&byte| byte != PAINT).unwrap();
        let record = options.image.with_extension("stack");
        let bound: usize = fs::read_to_string(&record).unwrap().trim().parse().unwrap();
        println!("{}: {used} bytes of stack used, bound {bound}", options.machine.name());
        assert!(used <= bound, "{used} bytes were used, the bound is {bound}");
        assert!(2 * used > bound, "a bound of {bound} for {used} bytes bounds little");
    }
}
