//! Tests of the settings' store over a model of the part's flash interface, register by register:
//! no emulator has one.
#![allow(clippy::unwrap_used, reason = "tests")]

mod model;

use std::ops::Range;

use echoloop_dsp::{Hardware, Settings};
use echoloop_sensor::store::{Saved, StoreError, forget, load, save};
use echoloop_stm32f4::flash::{
    ENDURANCE, FIRST_SECTOR, Flash, FlashError, Interface, OFFSET, SECTOR, SECTORS,
};
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use model::Model;

const HARDWARE: Hardware = Hardware::REFERENCE;

/// Address of the part's flash.
const ARRAY: u64 = 0x0800_0000;

fn set(i: i32) -> Settings {
    Settings { gain_cdb: i, ..Settings::default() }
}

/// Flash after `times` saves.
fn worn(times: i32) -> Flash<Model> {
    let mut flash = Flash::new(Model::new());
    for i in 1..=times {
        assert_eq!(save(&mut flash, &HARDWARE, &set(i)), Ok(i as u32));
    }
    flash
}

fn settings(flash: &mut Flash<Model>) -> Option<Settings> {
    load(flash, &HARDWARE).map(|saved| saved.settings)
}

#[test]
fn settings_come_back_after_the_power_from_two_sectors_and_nothing_else_changes() {
    let new = Model::new();
    let ours = OFFSET as usize..(OFFSET + SECTORS * SECTOR) as usize;
    let mut flash = worn(0);
    for i in 1..=6 {
        save(&mut flash, &HARDWARE, &set(i)).unwrap();
        let part = flash.interface_mut();
        assert!(part.is_locked(), "after save {i}");
        assert!(part.array[..ours.start] == new.array[..ours.start], "sector 0 after save {i}");
        assert!(part.array[ours.end..] == new.array[ours.end..], "the code after save {i}");
        part.switch_on();
        let saved = Saved { revision: i as u32, settings: set(i) };
        assert_eq!(load(&mut flash, &HARDWARE), Some(saved));
    }
    assert_eq!(flash.interface_mut().erased, [0, 3, 3, 0, 0], "they wear alike");
    forget(&mut flash, &HARDWARE).unwrap();
    assert_eq!(settings(&mut flash), None);
}

#[test]
fn a_power_cut_anywhere_in_a_save_leaves_the_old_settings_or_the_new() {
    let mut cuts = 0;
    for (times, step, seed) in
        (0..3).flat_map(|t| (0..70).flat_map(move |step| (0..8).map(move |seed| (t, step, seed))))
    {
        let old = (times > 0).then(|| set(times));
        let mut flash = worn(times);
        flash.interface_mut().cut_after(step, seed);
        if save(&mut flash, &HARDWARE, &set(100)).is_ok() {
            continue;
        }
        cuts += 1;
        flash.interface_mut().switch_on();
        let found = settings(&mut flash);
        assert!(
            found == old || found == Some(set(100)),
            "{times} saves, cut in step {step}, seed {seed}: {found:?}"
        );
        save(&mut flash, &HARDWARE, &set(200)).unwrap();
        assert_eq!(settings(&mut flash), Some(set(200)));
    }
    // A sector and 64 words, each torn in eight ways, from three states.
    assert_eq!(cuts, 3 * 8 * (1 + 64));
}

#[test]
fn what_the_data_cache_held_before_a_save_is_not_read_after_it() {
    let mut part = Model::new();
    let before = part.word(OFFSET);
    part.array[OFFSET as usize] ^= 1;
    assert_eq!(part.word(OFFSET), before, "the model's cache is one");
    let mut flash = worn(2);
    assert_eq!(settings(&mut flash), Some(set(2))); // both slots are in the cache now
    save(&mut flash, &HARDWARE, &set(3)).unwrap();
    assert_eq!(settings(&mut flash), Some(set(3)));
}

#[test]
fn an_error_is_said_and_does_not_spoil_what_follows() {
    let mut flash = worn(1);
    flash.interface_mut().protected = true;
    assert_eq!(save(&mut flash, &HARDWARE, &set(2)), Err(StoreError::Flash));
    assert_eq!(flash.erase(0, SECTOR), Err(FlashError::Status(1 << 4)));
    assert!(flash.interface_mut().is_locked());
    flash.interface_mut().protected = false;
    flash.interface_mut().leave_error();
    assert_eq!(save(&mut flash, &HARDWARE, &set(2)), Ok(2));
    assert_eq!(settings(&mut flash), Some(set(2)));
}

#[test]
fn a_flash_that_does_not_open_is_left_as_it_is() {
    let mut flash = worn(1);
    flash.interface_mut().jam();
    let before = flash.interface_mut().array.clone();
    assert_eq!(save(&mut flash, &HARDWARE, &set(2)), Err(StoreError::Flash));
    assert_eq!(flash.write(64, &[0; 4]), Err(FlashError::Locked));
    assert!(flash.interface_mut().array == before);
    flash.interface_mut().switch_on();
    assert_eq!(save(&mut flash, &HARDWARE, &set(2)), Ok(2));
}

#[test]
fn places_outside_of_the_two_sectors_are_refused() {
    let mut flash = worn(0);
    assert_eq!(flash.capacity(), 32 << 10);
    let end = SECTORS * SECTOR;
    assert!(matches!(flash.erase(0, end + SECTOR), Err(FlashError::Place(_))));
    assert!(matches!(flash.erase(4, SECTOR), Err(FlashError::Place(_))));
    assert!(matches!(flash.write(end, &[0; 4]), Err(FlashError::Place(_))));
    assert!(matches!(flash.write(2, &[0; 4]), Err(FlashError::Place(_))));
    assert!(matches!(flash.read(end - 4, &mut [0; 8]), Err(FlashError::Place(_))));
    assert_eq!((flash.interface_mut().erased, flash.interface_mut().written), ([0; 5], 0));
}

/// Regions of the linker script: names, and addresses within.
fn regions(script: &str) -> Vec<(&str, Range<u64>)> {
    let lines = script.lines().filter_map(|line| line.split_once(": ORIGIN = 0x"));
    lines
        .map(|(name, rest)| {
            let (origin, length) = rest.split_once(", LENGTH = ").unwrap();
            let origin = u64::from_str_radix(origin, 16).unwrap();
            let kilobytes: u64 = length.trim_end().strip_suffix('K').unwrap().parse().unwrap();
            (name.trim(), origin..origin + (kilobytes << 10))
        })
        .collect()
}

#[test]
fn the_linker_puts_nothing_into_the_settings_sectors() {
    let regions = regions(include_str!("../../link/stm32f405.x"));
    let first = ARRAY + u64::from(FIRST_SECTOR * SECTOR);
    let settings = first..first + u64::from(SECTORS * SECTOR);
    assert_eq!(settings, 0x0800_4000..0x0800_C000);
    for (name, region) in &regions {
        let apart = region.end <= settings.start || settings.end <= region.start;
        assert!(apart, "{name} at {region:x?} holds settings at {settings:x?}");
    }
    let flash: Vec<Range<u64>> = regions
        .iter()
        .filter(|(name, _)| name.starts_with("FLASH"))
        .map(|(_, region)| region.clone())
        .collect();
    // Sector 0, and sectors 4 to 11 to the end of 1 MB.
    assert_eq!(flash, [ARRAY..ARRAY + (16 << 10), ARRAY + (64 << 10)..ARRAY + (1 << 20)]);
}

#[test]
fn the_page_says_how_many_saves_the_sectors_stand() {
    let page = include_str!("../../../../docs/microcontroller.md");
    let saves = SECTORS * ENDURANCE;
    let said = format!("{},{:03} saves", saves / 1_000, saves % 1_000);
    assert!(page.contains(&said), "docs/microcontroller.md does not say {said}");
}
