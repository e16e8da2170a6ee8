//! The image for an STM32F405, a part on sale, in QEMU's `netduinoplus2`: the same file that is
//! flashed.
//!
//! QEMU 7.2 does not model the part's clocks, flash interface and independent watchdog. There the
//! image leaves the clocks, keeps settings in a file, uses the tick as its watchdog, and logs so
//! (`firmware/stm32f4/src/lib.rs`). So these tests do not cover the flash's driver, which
//! `firmware/stm32f4/tests/flash` runs on a model of the registers, nor the independent watchdog
//! and the speed of the lines, which need a board.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests")]

mod board;
mod clock;
mod fed;

use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use echoloop_dsp::Settings;
use echoloop_link::{Command, Greeting, MAX_FRAME, Nack, Report, Times, encode, settings_hash};
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::transport::Transport;
use echoloop_tests::faults::{Faulty, Rates};
use echoloop_tests::gdb::Gdb;
use echoloop_tests::target::{assert_stack_bound, paint_stack, symbol};

use board::{answers, board, connect, gain, log, start, start_and_wait, wait_for_log, with_gdb};
use fed::{BEAMS, Fed, case, on_the_pc};

#[test]
fn the_second_port_and_the_debugger_have_the_same_log() {
    let Some((mut options, folder)) = board() else { return };
    let socket = with_gdb(&mut options, &folder);
    let mut client = connect(&options);
    assert!(client.identity().build.starts_with("echoloop-sensor "), "{:?}", client.identity());
    client.configure(&gain(700)).unwrap();
    assert_eq!(client.read_settings().unwrap(), gain(700));
    // It has no laser and no converter, and reports so.
    assert!(matches!(client.scan(1), Err(ClientError::Nack(Nack::FrontEnd))));
    let frames = fs::read(client.transport_mut().log_file()).unwrap();
    let lines = log(&options.image, &frames);
    assert!(lines[0].contains("QEMU") && lines[0].contains("watchdog"), "{lines:?}");
    assert!(lines[1].contains("echoloop-sensor"), "{lines:?}");

    // The control block that a debugger looks for: name, sizes, then the first channel.
    let mut gdb = Gdb::connect(&socket).unwrap();
    let block = gdb.read(symbol(&options, "_SEGGER_RTT"), 48).unwrap();
    assert_eq!(&block[..16], b"SEGGER RTT\0\0\0\0\0\0");
    let word = |at: usize| u32::from_le_bytes(block[at..at + 4].try_into().unwrap());
    let [channels, name, buffer, written] = [16, 24, 28, 36].map(word);
    assert_eq!(channels, 1);
    assert_eq!(gdb.read(name, 6).unwrap(), b"defmt\0");
    assert_eq!(gdb.read(buffer, written as usize).unwrap(), frames);
}

#[test]
fn a_power_cut_during_a_save_leaves_the_old_settings_or_the_new() {
    let Some((options, _folder)) = board() else { return };
    let mut before = Settings::default();
    let (mut old, mut new) = (0, 0);
    for round in 0..12 {
        let mut client = connect(&options);
        assert_eq!(client.read_settings().unwrap(), before, "round {round}");
        let wanted = gain(round + 1);
        let hash = client.configure(&wanted).unwrap();
        let save = Command::Save { hash };
        client.transport_mut().send(encode(100, &save, &mut [0; MAX_FRAME]).unwrap()).unwrap();
        // After 0 to 3 ms: the first save has not begun, the last one is done.
        thread::sleep(Duration::from_micros(25 * (round * round) as u64));
        drop(client); // the emulator is killed
        let found = connect(&options).read_settings().unwrap();
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
fn a_hanging_program_is_restarted_with_the_saved_settings() {
    let Some((mut options, folder)) = board() else { return };
    let socket = with_gdb(&mut options, &folder);
    let mut client = connect(&options);
    let (saved, active) = (gain(1_100), gain(1_200));
    client.configure(&saved).unwrap();
    client.save().unwrap();
    client.configure(&active).unwrap();
    assert_eq!(client.read_counters().unwrap().restarts, 0);
    // Stopped while it works: asleep, it has interrupts masked, and so the tick that replaces the
    // watchdog.
    let hello =
        encode(60_000, &Command::Hello(Greeting::OURS), &mut [0; MAX_FRAME]).unwrap().to_vec();
    let mut gdb = Gdb::connect(&socket).unwrap();
    let send = || client.transport_mut().send(&hello).unwrap();
    gdb.run_to(symbol(&options, "take_byte") & !1, send).unwrap();
    gdb.jump(symbol(&options, "DefaultHandler_") & !1).unwrap(); // an endless loop
    gdb.detach().unwrap();
    let after = (0..8).find_map(|_| client.read_settings().ok()).unwrap();
    assert_eq!(after, saved);
    assert_eq!(client.read_counters().unwrap().restarts, 1);
    assert_eq!(client.configure(&active).map_err(|e| e.to_string()), Ok(settings_hash(&active)));
}

#[test]
fn behind_a_bad_line_it_never_has_settings_that_were_not_sent() {
    let Some((options, _folder)) = board() else { return };
    let retry_policy = RetryPolicy { timeout: Duration::from_millis(40), tries: 12 };
    let line = Faulty::new(start_and_wait(&options), 5);
    let mut client = Client::connect_from(line, retry_policy, 0).unwrap();
    let mut before = Settings::default();
    let (mut done, mut reported) = (0, 0);
    for step in 0..150 {
        let wanted = gain(step + 1);
        client.transport_mut().rates = Rates::all(0.03);
        let configured = client.configure(&wanted);
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
    let harmed = client.transport_mut().harmed;
    println!("{done} done, {reported} reported, {harmed} messages harmed");
    assert!(done > 100, "{done} of 150 were done");
}

#[test]
fn bytes_that_arrive_while_it_works_wait_in_the_ring() {
    let Some((options, _folder)) = board() else { return };
    let mut board = start_and_wait(&options);
    // As many bytes as two frames of the greatest length, which the board accepts at once.
    let mut burst = Vec::new();
    let mut count = 0;
    while burst.len() + 16 < 2 * MAX_FRAME {
        count += 1;
        let command =
            if count == 1 { Command::Hello(Greeting::OURS) } else { Command::ReadSettings };
        burst.extend_from_slice(encode(count, &command, &mut [0; MAX_FRAME]).unwrap());
    }
    board.send(&burst).unwrap();
    let numbers: Vec<u16> = answers(&mut board, count.into()).iter().map(|(n, _)| *n).collect();
    assert_eq!(numbers, (1..=count).collect::<Vec<u16>>(), "{} bytes", burst.len());
    let lines = log(&options.image, &fs::read(board.log_file()).unwrap());
    assert!(!lines.iter().any(|line| line.contains("lost")), "{lines:?}");
}

#[test]
fn it_finds_the_pc_s_echoes_in_2048_waveforms() {
    let Some((options, _folder)) = board() else { return };
    let waveforms: usize =
        std::env::var("ECHOLOOP_WAVEFORMS").map_or(2_048, |text| text.parse().unwrap());
    let (mut fed, mut echoes) = (Fed::of(start_and_wait(&options)), 0);
    for seed in 0..waveforms.div_ceil(BEAMS) as u64 {
        let (settings, waves) = case(seed);
        fed.configure(&settings);
        let found = fed.echoes(&waves, settings.shots as usize);
        assert_eq!(found, on_the_pc(&settings, &waves), "seed {seed}: {settings:?}");
        echoes += found.iter().map(|echoes| echoes.len()).sum::<usize>();
    }
    println!("{waveforms} waveforms, {echoes} echoes");
    assert!(echoes > waveforms / 4, "{echoes} echoes of {waveforms} waveforms compare little");
    let lines = log(&options.image, &fs::read(fed.board.log_file()).unwrap());
    assert!(!lines.iter().any(|line| line.contains("lost")), "{lines:?}");
}

#[test]
fn its_clock_counts_microseconds() {
    const COUNTER: u32 = 0x4000_0C24;
    let Some((mut options, folder)) = board() else { return };
    let socket = with_gdb(&mut options, &folder);
    let begun = Instant::now();
    let mut fed = Fed::of(start_and_wait(&options));
    let set = fed.ask(&[Command::SetDeadline { scan_us: 100_000 }]).pop();
    let expected = Times { clock: true, deadline_us: 100_000, ..Times::default() };
    assert_eq!(set, Some(Report::Times(expected)));
    let now_us = || {
        let mut gdb = Gdb::connect(&socket).unwrap(); // stops the processor until detached
        let bytes = gdb.read(COUNTER, 4).unwrap();
        gdb.detach().unwrap();
        u32::from_le_bytes(bytes.try_into().unwrap())
    };
    let before = now_us();
    thread::sleep(Duration::from_millis(300));
    let passed = now_us().wrapping_sub(before);
    let most = begun.elapsed().as_micros();
    assert!(passed > 250_000 && u128::from(passed) < most, "{passed} µs of 300 ms to {most} µs");
}

#[test]
fn the_stack_stays_within_its_bound() {
    const PAINTED: u32 = 72 << 10;
    let Some((mut options, folder)) = board() else { return };
    let socket = with_gdb(&mut options, &folder);
    options.arguments.push("-S".into()); // stopped before its first instruction
    let board = start(&options);
    paint_stack(&options, &socket, PAINTED);
    wait_for_log(&board);
    let mut fed = Fed::of(board);
    for seed in 0..4 {
        let (settings, waves) = case(seed);
        fed.configure(&settings);
        fed.echoes(&waves, settings.shots as usize);
    }
    fed.ask(&[Command::ReadCounters]);
    assert_stack_bound(&options, &socket, PAINTED);
}
