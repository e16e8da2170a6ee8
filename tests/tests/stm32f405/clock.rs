//! The part's clocks, which the emulator does not model: checked by the writes to their registers.

use std::fs;
use std::time::{Duration, Instant};

use echoloop_tests::gdb::Gdb;
use echoloop_tests::target::symbol;

use crate::board::{board, connect, with_gdb};

/// Values written to a register, from the emulator's log of registers that it does not model.
fn written(log: &str, device: &str, offset: u32) -> Vec<u32> {
    let place = format!("offset 0x{offset:03x}, value 0x");
    let lines = log.lines().filter(|line| line.starts_with(device) && line.contains("write"));
    lines
        .filter_map(|line| line.split_once(&place))
        .map(|(_, value)| u32::from_str_radix(value.trim_end_matches(')'), 16).unwrap())
        .collect()
}

#[test]
fn the_part_s_clocks_are_set_to_168_mhz_without_a_panic() {
    let Some((mut options, folder)) = board() else { return };
    let socket = with_gdb(&mut options, &folder);
    let unmodelled = folder.path().join("unmodelled.txt");
    let log_of_those = ["-d", "unimp", "-D", unmodelled.to_str().unwrap()];
    options.arguments.extend(log_of_those.map(String::from));
    let mut client = connect(&options);
    let mut gdb = Gdb::connect(&socket).unwrap();
    let begun = fs::metadata(&unmodelled).unwrap().len() as usize;
    gdb.jump(symbol(&options, "5clock5start") & !1).unwrap();
    gdb.detach().unwrap();
    // The HAL computes everything that could panic, sets the PLL, and waits for it, here for ever.
    let (pll_on, deadline) = (1 << 24, Instant::now() + Duration::from_secs(10));
    let log = loop {
        let log = fs::read_to_string(&unmodelled).unwrap().split_off(begun);
        if written(&log, "RCC", 0x00).iter().any(|value| value & pll_on != 0) {
            break log;
        }
        assert!(Instant::now() < deadline, "the PLL was not switched on: {log}");
    };
    let pll = written(&log, "RCC", 0x04)[0];
    let field = |shift: u32, bits: u32| u64::from(pll >> shift & ((1 << bits) - 1));
    let (m, n, p) = (field(0, 6), field(6, 9), 2 * (field(16, 2) + 1));
    assert_eq!(pll >> 22 & 1, 0, "from the part's own 16 MHz");
    let input_hz = 16_000_000 / m;
    assert!((1_000_000..=2_000_000).contains(&input_hz), "{input_hz} Hz into the PLL");
    assert_eq!(input_hz * n / p, 168_000_000, "PLLCFGR {pll:#010x}");
    // Five wait states at 168 MHz and 3.3 V, prefetch and both caches on.
    assert_eq!(written(&log, "Flash", 0x000).last(), Some(&0x705), "{log}");
    // It still waits there and has not panicked.
    let frames = fs::read(client.transport_mut().log_file()).unwrap();
    assert!(!crate::board::log(&options.image, &frames).iter().any(|line| line.contains("panic")));
    let waits = Gdb::connect(&socket).unwrap().program_counter().unwrap();
    let begin = symbol(&options, "5clock5start") & !1;
    assert!((begin..begin + 4096).contains(&waits), "at {waits:#x}, not in {begin:#x}…");
}
