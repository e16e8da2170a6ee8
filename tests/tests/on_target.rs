//! The firmware image on boards in QEMU: the same bytes as in process, and recovery from hangs,
//! power cuts and bad lines.
//!
//! `cargo xtask firmware` builds the images. `ECHOLOOP_WAVEFORMS=100000` lengthens the comparison.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::time::{Duration, Instant};

use echoloop_dsp::accumulate::Accumulator;
use echoloop_dsp::loops::Scalar;
use echoloop_dsp::{Echoes, Grid, Hardware, MAX_CODES, Pipeline, ScanPattern, Scratch, Settings};
use echoloop_frontend::{Analog, FrontEnd, Trigger};
use echoloop_kernels::process_baseline;
use echoloop_link::{Command, MAX_FRAME, Room, Times, encode, settings_hash};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::boards::qemu::{Machine, Qemu, QemuOptions};
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::defmt_log;
use echoloop_sensors::transport::{InProcess, Transport};
use echoloop_tests::faults::{Faulty, Rates};
use echoloop_tests::gdb::Gdb;
use echoloop_tests::recording::{Direction, Recording};
use echoloop_tests::target::{assert_stack_bound, machine, machines, paint_stack, symbol};
use echoloop_tests::vectors::{self, KINDS};

/// A pattern with the beams of one report.
const PATTERN: ScanPattern =
    ScanPattern::Grid(Grid { columns: 8, rows: 4, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 });
const BEAMS: usize = 32;

/// Timeouts long enough for an emulator on a busy machine.
const RETRY_POLICY: RetryPolicy = RetryPolicy { timeout: Duration::from_secs(5), tries: 4 };

/// A front end with a given waveform for each beam.
#[derive(Clone, Default)]
struct Waveforms {
    adc_bits: u32,
    beams: Vec<Vec<u16>>,
}

impl FrontEnd for Waveforms {
    fn adc_bits(&self) -> u32 {
        self.adc_bits
    }

    fn capture(&mut self, _: &Analog, trigger: Trigger, codes: &mut [u16]) {
        codes.fill(0);
        if let Some(wave) = self.beams.get(trigger.beam as usize) {
            let length = wave.len().min(codes.len());
            codes[..length].copy_from_slice(&wave[..length]);
        }
    }
}

fn start(options: &QemuOptions, hardware: Hardware) -> Client<Qemu<Waveforms>> {
    let front_end = Waveforms { adc_bits: hardware.adc_bits, ..Waveforms::default() };
    let qemu = Qemu::start(options, front_end, PATTERN, hardware).unwrap();
    Client::connect_from(qemu, RETRY_POLICY, 0).unwrap()
}

/// Draws settings and a waveform for each beam, kinds in turn.
fn case(seed: u64, hardware: &Hardware) -> (Settings, Vec<Vec<u16>>) {
    let mut rng = vectors::rng(seed);
    let settings = vectors::settings(&mut rng, hardware);
    let kinds = KINDS.iter().cycle().take(BEAMS);
    let beams = kinds.map(|&kind| {
        let mut wave = vectors::waveform(&settings, hardware, kind, &mut rng);
        // A front end gives all samples.
        wave.resize((settings.pre_trigger_samples() + settings.bins as u32) as usize, 0);
        wave
    });
    (settings, beams.collect())
}

/// Sum of a beam's shots when all have the same waveform.
fn summed(pipeline: &Pipeline, wave: &[u16]) -> Vec<u16> {
    let config = pipeline.config();
    let mut shots = Accumulator::new();
    (0..config.shots).for_each(|shot| shots.add(shot, wave));
    let mut codes = vec![0; wave.len()];
    shots.read(config.sum_shift, &mut codes);
    codes
}

/// Echoes of a scan with these settings.
fn measure<T: Transport>(client: &mut Client<T>, settings: &Settings) -> Vec<Echoes> {
    client.configure(settings).unwrap();
    client.scan(1).unwrap()
}

#[test]
fn every_board_counts_the_scans_that_take_too_long() {
    for options in machines() {
        let name = options.machine.name();
        let mut board = start(&options, Hardware::REFERENCE);
        for (deadline_us, late) in [(1, 3), (u32::MAX, 0), (0, 0)] {
            board.set_deadline(deadline_us).unwrap();
            let begun = Instant::now();
            (1..4).for_each(|scan| drop(board.scan(scan).unwrap()));
            let most = begun.elapsed().as_micros();
            let Times { clock, scans, late: found, last_us, longest_us, .. } =
                board.read_times().unwrap();
            assert_eq!((clock, scans, found), (true, 3, late), "{name}, {deadline_us} µs");
            assert!(0 < last_us && last_us <= longest_us, "{name}: {last_us} of {longest_us}");
            // The emulator's clock is the machine's.
            assert!(u128::from(longest_us) <= most, "{name}: {longest_us} µs of {most}");
        }
    }
}

/// QEMU's clock counts instructions here, 64 ns each, so the firmware's stopwatch does, too.
#[test]
fn receiving_waveforms_costs_about_as_much_as_detecting_their_echoes() {
    const NS: f64 = 64.0;
    let Some(mut options) = machine(Machine::An386) else { return };
    options.arguments = ["-icount", "shift=6,sleep=off"].map(String::from).to_vec();
    let mut board = start(&options, Hardware::REFERENCE);
    let settings = Settings::default();
    board.configure(&settings).unwrap();
    let room = Room { frames: 1, ..board.read_room().unwrap() };
    let pulse = |i: usize| 1_000.0 * (1.0 - (i as f64 - 300.0).abs() / 5.0).max(0.0);
    let wave: Vec<u16> = (0..800).map(|i| 200 + (i % 5) as u16 + pulse(i) as u16).collect();
    let mut shoot = |_, _, codes: &mut [u16]| {
        codes.copy_from_slice(&wave);
        Ok(())
    };
    board.set_deadline(1).unwrap();
    let beams = board.scan_waveforms(1, room, &mut shoot).unwrap();
    assert!(beams.iter().all(|echoes| echoes.len() == 1), "one echo a beam");
    let busy_us = f64::from(board.read_times().unwrap().last_us);
    let each = 1e3 * busy_us / NS / BEAMS as f64;
    let detector = counted("cortex-m4", "dual_multiply", "800x12 one echo");
    println!("{each:.0} instructions a beam, {detector} of them the detector's");
    assert!((1.5..2.5).contains(&(each / detector)), "{each} of {detector}");
}

/// Instructions of the detector in the record.
fn counted(processor: &str, kernel: &str, case: &str) -> f64 {
    let record = include_str!("../../firmware/image/cost.tsv");
    let name = [processor, kernel, case, "pipeline", ""].join("\t");
    let figure = record.lines().find_map(|line| line.strip_prefix(&name)).unwrap();
    figure.parse().unwrap()
}

#[test]
fn every_board_finds_the_same_echoes_as_the_pc() {
    let waveforms: usize =
        std::env::var("ECHOLOOP_WAVEFORMS").map_or(2_048, |text| text.parse().unwrap());
    let sensors =
        [Hardware::REFERENCE, Hardware { adc_bits: 14, range_min_mm: 0, ..Hardware::REFERENCE }];
    for options in machines() {
        let mut echoes = 0;
        let begun = Instant::now();
        for (hardware, first) in sensors.into_iter().zip([0, 1_000_000]) {
            let front_end = Waveforms { adc_bits: hardware.adc_bits, ..Waveforms::default() };
            let mut pc = Client::connect(
                InProcess(PcSensor::new(front_end, PATTERN, hardware)),
                RetryPolicy::default(),
            )
            .unwrap();
            let mut board = start(&options, hardware);
            let mut scratch = Scratch::new();
            for seed in first..first + waveforms.div_ceil(sensors.len() * BEAMS) as u64 {
                let (settings, beams) = case(seed, &hardware);
                pc.transport_mut().0.front_end_mut().beams.clone_from(&beams);
                board.transport_mut().front_end_mut().beams.clone_from(&beams);
                let vectorised = measure(&mut pc, &settings);
                let on_board = measure(&mut board, &settings);
                assert_eq!(
                    on_board,
                    vectorised,
                    "{}, seed {seed}: {settings:?}",
                    options.machine.name()
                );
                let pipeline = Pipeline::new(&settings, &hardware).unwrap();
                let beams: Vec<Vec<u16>> =
                    beams.iter().map(|wave| summed(&pipeline, wave)).collect();
                let portable: Vec<Echoes> =
                    beams.iter().map(|w| process_baseline(&pipeline, w, &mut scratch)).collect();
                assert_eq!(portable, vectorised, "seed {seed}: {settings:?}");
                let scalar: Vec<Echoes> =
                    beams.iter().map(|w| pipeline.process(Scalar, w, &mut scratch)).collect();
                assert_eq!(scalar, vectorised, "seed {seed}: {settings:?}");
                echoes += scalar.iter().map(|e| e.len()).sum::<usize>();
            }
        }
        let rate = waveforms as f64 / begun.elapsed().as_secs_f64();
        println!(
            "{}: {waveforms} waveforms, {echoes} echoes, {rate:.0} waveforms/s",
            options.machine.name()
        );
        assert!(echoes > waveforms / 4, "{echoes} echoes of {waveforms} waveforms compare little");
    }
}

#[test]
fn the_stack_stays_within_the_bound_that_the_image_is_built_with() {
    const PAINTED: u32 = 64 << 10;
    for mut options in machines() {
        let folder = tempfile::tempdir().unwrap();
        options.folder = Some(folder.path().to_owned());
        let socket = folder.path().join("gdb");
        options.arguments = Gdb::arguments(&socket).into();
        options.arguments.push("-S".into()); // stopped before its first instruction
        let front_end = Waveforms { adc_bits: 12, ..Waveforms::default() };
        let qemu = Qemu::start(&options, front_end, PATTERN, Hardware::REFERENCE);
        paint_stack(&options, &socket, PAINTED);
        let mut client = Client::connect(qemu.unwrap(), RETRY_POLICY).unwrap();
        for seed in 0..8 {
            let (settings, beams) = case(seed, &Hardware::REFERENCE);
            client.transport_mut().front_end_mut().beams = beams;
            measure(&mut client, &settings);
        }
        client.read_counters().unwrap();
        assert_stack_bound(&options, &socket, PAINTED);
    }
}

/// A conversation with every kind of command.
fn talk<T: Transport>(client: &mut Client<T>) {
    client.scan(1).unwrap();
    client.configure(&gain(100)).unwrap();
    client.configure_on_trial(&gain(200), 1).unwrap();
    client.scan(2).unwrap();
    client.configure_on_trial(&gain(300), 2).unwrap();
    client.scan(3).unwrap();
    client.confirm().unwrap();
    client.save().unwrap();
    client.configure(&gain(9_999)).unwrap_err();
    client.forget().unwrap();
    client.read_counters().unwrap();
}

fn gain(gain_cdb: i32) -> Settings {
    Settings { gain_cdb, ..Settings::default() }
}

#[test]
fn a_conversation_with_a_board_replayed_in_process_has_the_same_answers() {
    for options in machines() {
        let front_end = Waveforms { adc_bits: 12, beams: case(1, &Hardware::REFERENCE).1 };
        let qemu = Qemu::start(&options, front_end.clone(), PATTERN, Hardware::REFERENCE).unwrap();
        let mut client = Client::connect_from(Recording::new(qemu), RETRY_POLICY, 7).unwrap();
        talk(&mut client);
        let recorded = client.transport_mut().conversation().clone();
        let pc = InProcess(PcSensor::new(front_end, PATTERN, Hardware::REFERENCE));
        let again = recorded.replay(pc, Duration::ZERO).unwrap();
        let (board, pc) = (recorded.bytes(Direction::ToHost), again.bytes(Direction::ToHost));
        assert!(board.len() > 500, "{} bytes compare little", board.len());
        assert_eq!(board, pc, "{}", options.machine.name());
    }
}

#[test]
fn the_watchdog_restarts_a_hanging_program_with_the_saved_settings() {
    for kind in [Machine::An386, Machine::An500, Machine::An505, Machine::An547] {
        let Some(mut options) = machine(kind) else { continue };
        let folder = tempfile::tempdir().unwrap();
        options.folder = Some(folder.path().to_owned());
        let socket = folder.path().join("gdb");
        options.arguments = Gdb::arguments(&socket).into();
        let mut client = start(&options, Hardware::REFERENCE);
        let (saved, active) = (gain(1_100), gain(1_200));
        client.configure(&saved).unwrap();
        client.save().unwrap();
        client.configure(&active).unwrap();
        assert_eq!(client.read_counters().unwrap().restarts, 0);
        let mut gdb = Gdb::connect(&socket).unwrap();
        gdb.jump(symbol(&options, "DefaultHandler_") & !1).unwrap(); // an endless loop
        gdb.detach().unwrap();
        // Unanswered at first; then the sensor has lost the session, and the client says hello.
        let after = (0..8).find_map(|_| client.read_settings().ok()).unwrap();
        assert_eq!(after, saved, "{}", kind.name());
        assert_eq!(client.read_counters().unwrap().restarts, 1, "{}", kind.name());
        assert_eq!(
            client.configure(&active).map_err(|e| e.to_string()),
            Ok(settings_hash(&active))
        );
        client.scan(9).unwrap();
    }
}

#[test]
fn an_image_for_another_board_with_the_same_flash_address_is_refused() {
    let (Some(an505), Some(an547)) = (machine(Machine::An505), machine(Machine::An547)) else {
        return;
    };
    for (board, other) in [(&an505, &an547), (&an547, &an505)] {
        let options = QemuOptions { image: other.image.clone(), ..board.clone() };
        let blind = Waveforms { adc_bits: 12, ..Waveforms::default() };
        let refused = Qemu::start(&options, blind, PATTERN, Hardware::REFERENCE).err().unwrap();
        let (what, wanted) = (refused.to_string(), board.machine.target());
        assert!(what.contains("another board") && what.contains(wanted), "{what}");
    }
}

#[test]
fn a_power_cut_during_a_save_leaves_a_board_the_old_settings_or_the_new() {
    let Some(mut options) = machine(Machine::An386) else { return };
    let folder = tempfile::tempdir().unwrap();
    options.folder = Some(folder.path().to_owned());
    let mut before = Settings::default();
    let (mut old, mut new) = (0, 0);
    for round in 0..30 {
        let mut client = start(&options, Hardware::REFERENCE);
        assert_eq!(client.read_settings().unwrap(), before, "round {round}");
        let wanted = gain(round + 1);
        let hash = client.configure(&wanted).unwrap();
        let save = Command::Save { hash };
        client.transport_mut().send(encode(100, &save, &mut [0; MAX_FRAME]).unwrap()).unwrap();
        std::thread::sleep(Duration::from_micros(700 * round as u64));
        drop(client); // the emulator is killed
        let mut after = start(&options, Hardware::REFERENCE);
        let found = after.read_settings().unwrap();
        assert!(found == before || found == wanted, "round {round}: {found:?}");
        if found == wanted {
            new += 1
        } else {
            old += 1
        }
        before = found;
    }
    println!("{old} times the old settings, {new} times the new");
    assert!(new > 0 && old > 0, "{new} saves were done, {old} were cut");
}

#[test]
fn a_board_behind_a_bad_line_never_has_settings_that_were_not_sent() {
    let Some(options) = machine(Machine::An386) else { return };
    let front_end = Waveforms { adc_bits: 12, ..Waveforms::default() };
    let qemu = Qemu::start(&options, front_end, PATTERN, Hardware::REFERENCE).unwrap();
    let retry_policy = RetryPolicy { timeout: Duration::from_millis(40), tries: 12 };
    let mut client = Client::connect_from(Faulty::new(qemu, 5), retry_policy, 0).unwrap();
    let mut before = Settings::default();
    let (mut done, mut reported) = (0, 0);
    let mut times = Vec::new();
    for step in 0..150 {
        let wanted = gain(step + 1);
        client.transport_mut().rates = Rates::all(0.03);
        let begun = Instant::now();
        let configured = client.configure(&wanted);
        times.push(begun.elapsed());
        client.transport_mut().rates = Rates::NONE;
        let now = (0..4).find_map(|_| client.read_settings().ok()).unwrap();
        match configured {
            Ok(_) => {
                done += 1;
                assert_eq!(now, wanted, "step {step}");
            }
            Err(_) => {
                reported += 1;
                assert!(now == before || now == wanted, "step {step}: {now:?}");
            }
        }
        before = now;
    }
    times.sort_unstable();
    println!(
        "{done} done, {reported} reported, {} messages harmed; stage and commit take {:.1?}, \
         the slowest of all {:.1?}",
        client.transport_mut().harmed,
        times[times.len() / 2],
        times[times.len() - 1]
    );
    assert!(done > 100, "{done} of 150 were done");
}

#[test]
fn the_board_s_log_names_the_settings_that_became_active() {
    let Some(options) = machine(Machine::An386) else { return };
    let mut client = start(&options, Hardware::REFERENCE);
    let hash = client.configure(&gain(700)).unwrap();
    client.scan(1).unwrap();
    let frames = fs::read(client.transport_mut().log_file()).unwrap();
    let lines = defmt_log::decode(&fs::read(&options.image).unwrap(), &frames).unwrap();
    assert!(lines[0].contains("echoloop-sensor"), "{lines:?}");
    assert!(
        lines
            .iter()
            .any(|l| l.contains(&format!("settings {hash:#010x} active")) && l.contains("700")),
        "{lines:?}"
    );
}

/// Scans with waveforms sent over the link.
fn feed<T: Transport>(
    client: &mut Client<T>,
    room: Room,
    beams: &[Vec<u16>],
) -> Result<Vec<Echoes>, ClientError> {
    client.scan_waveforms(1, room, &mut |beam, _, codes| {
        codes.copy_from_slice(&beams[beam as usize]);
        Ok(())
    })
}

#[test]
fn every_board_finds_the_pc_s_echoes_in_waveforms_over_a_bad_uart() {
    let hardware = Hardware::REFERENCE;
    for options in machines() {
        let blind = Waveforms { adc_bits: hardware.adc_bits, ..Waveforms::default() };
        let pc = InProcess(PcSensor::new(blind.clone(), PATTERN, hardware));
        let mut pc = Client::connect(pc, RetryPolicy::default()).unwrap();
        let qemu = Qemu::start(&options, blind, PATTERN, hardware).unwrap();
        let retry_policy = RetryPolicy { timeout: Duration::from_secs(2), tries: 20 };
        let mut board = Client::connect_from(Faulty::new(qemu, 5), retry_policy, 0).unwrap();
        let room = board.read_room().unwrap();
        assert_eq!(room, Room { codes: MAX_CODES as u32, frames: room.frames });
        let mut echoes = 0;
        for seed in 0..3 {
            let (drawn, mut beams) = case(seed, &hardware);
            // The link carries only the codes of a converter.
            let full_scale = hardware.full_scale_code();
            beams.iter_mut().flatten().for_each(|code| *code = (*code).min(full_scale));
            let settings = Settings { shots: 1 + (seed % 2) as i32, ..drawn };
            pc.transport_mut().0.front_end_mut().beams.clone_from(&beams);
            let expected = measure(&mut pc, &settings);
            board.transport_mut().rates = Rates::NONE;
            let configured = board.configure(&settings);
            configured.or_else(|_| board.configure(&settings)).unwrap();
            board.transport_mut().rates = if seed == 0 { Rates::NONE } else { Rates::all(0.008) };
            let fed = feed(&mut board, room, &beams).unwrap();
            assert_eq!(fed, expected, "{}, seed {seed}: {settings:?}", options.machine.name());
            echoes += fed.iter().flatten().count();
        }
        let harmed = board.transport_mut().harmed;
        println!("{}: {echoes} echoes, {harmed} messages harmed", options.machine.name());
        assert!(echoes > 30 && harmed > 0, "{echoes} echoes, {harmed} harms compare little");
    }
}
