//! Tests of the settings' store over a model of the part's flash controller: no emulator has one.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::cell::Cell;

use echoloop_dsp::{Hardware, Settings};
use echoloop_nrf52840::flash::{Access, ENDURANCE, Flash, Interface, OFFSET, PAGE, PAGES};
use echoloop_sensor::store::{forget, load, save};
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const HARDWARE: Hardware = Hardware::REFERENCE;

/// Beginning of the model: a page before the settings', theirs, and one behind.
const START: usize = (OFFSET - PAGE) as usize;
const BYTES: usize = ((PAGES + 2) * PAGE) as usize;

/// Controller and the pages around the settings' (Product Specification, 4.3). The power can fail
/// at any moment.
struct Model {
    array: Vec<u8>,
    /// Number of erases of each page, and of writes to each word since the last erase.
    erased: [u32; 4],
    written: Vec<u8>,
    access: Access,
    /// Number of reads of READY until the operation is done.
    busy: Cell<u32>,
    /// Number of words and pages until the power fails.
    left: Option<usize>,
    off: bool,
    tear: ChaCha8Rng,
}

impl Model {
    /// Model with other bytes around two erased pages.
    fn new() -> Self {
        let mut tear = ChaCha8Rng::seed_from_u64(52_840);
        let mut array = vec![0; BYTES];
        tear.fill_bytes(&mut array);
        array[PAGE as usize..3 * PAGE as usize].fill(0xFF);
        Self {
            array,
            erased: [0; 4],
            written: vec![0; BYTES / 4],
            access: Access::Read,
            busy: Cell::new(0),
            left: None,
            off: false,
            tear,
        }
    }

    fn cut_after(&mut self, steps: usize, seed: u64) {
        self.left = Some(steps);
        self.tear = ChaCha8Rng::seed_from_u64(seed);
    }

    fn switch_on(&mut self) {
        (self.left, self.off, self.access) = (None, false, Access::Read);
        self.busy.set(0);
    }

    /// Begins a page or a word: true when it ends whole, false when it is torn.
    fn step(&mut self) -> bool {
        self.busy.set(3);
        match &mut self.left {
            None => true,
            Some(0) => {
                self.off = true;
                false
            }
            Some(left) => {
                *left -= 1;
                true
            }
        }
    }

    fn ready_for(&self, access: Access) -> bool {
        assert_eq!(self.busy.get(), 0, "{access:?} while the controller is busy");
        assert!(self.off || self.access == access, "{access:?} while {:?} is set", self.access);
        !self.off
    }
}

impl Interface for Model {
    fn is_ready(&self) -> bool {
        let busy = self.busy.get();
        self.busy.set(busy.saturating_sub(1));
        busy == 0
    }

    fn allow(&mut self, access: Access) {
        assert_eq!(self.busy.get(), 0, "CONFIG is written while the controller is busy");
        self.access = access;
    }

    fn erase_page(&mut self, offset: u32) {
        if !self.ready_for(Access::Erase) {
            return;
        }
        let at = offset as usize - START;
        assert!(at.is_multiple_of(PAGE as usize), "the beginning of a page");
        let whole = self.step();
        for byte in &mut self.array[at..at + PAGE as usize] {
            *byte |= if whole { 0xFF } else { self.tear.next_u32() as u8 };
        }
        self.written[at / 4..(at + PAGE as usize) / 4].fill(0);
        self.erased[at / PAGE as usize] += 1;
    }

    fn word(&self, offset: u32) -> u32 {
        assert_eq!(self.busy.get(), 0, "the array is read while the controller is busy");
        assert!(self.off || self.access != Access::Erase, "the array is read while it is open");
        let at = offset as usize - START;
        u32::from_le_bytes(self.array[at..at + 4].try_into().unwrap())
    }

    fn set_word(&mut self, offset: u32, word: u32) {
        if !self.ready_for(Access::Write) {
            return;
        }
        let at = offset as usize - START;
        self.written[at / 4] += 1;
        assert_eq!(self.written[at / 4], 1, "word {offset:#x} is written again without an erase");
        let old = self.word(offset);
        let torn = if self.step() { 0 } else { self.tear.next_u32() };
        self.array[at..at + 4].copy_from_slice(&(old & (word | torn)).to_le_bytes());
    }
}

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
fn settings_come_back_from_two_pages_that_wear_alike_and_nothing_else_changes() {
    let mut flash = worn(6);
    assert_eq!(flash.interface_mut().access, Access::Read, "it is left closed");
    assert_eq!(settings(&mut flash), Some(set(6)));
    save(&mut flash, &HARDWARE, &set(6)).unwrap();
    assert_eq!(flash.interface_mut().erased, [0, 3, 3, 0], "what is saved already costs nothing");
    let (new, part) = (Model::new(), flash.interface_mut());
    let page = PAGE as usize;
    assert!(part.array[..page] == new.array[..page], "the code before");
    assert!(part.array[3 * page..] == new.array[3 * page..], "the bootloader behind");
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
        let done = save(&mut flash, &HARDWARE, &set(100));
        if !flash.interface_mut().off {
            assert!(done.is_ok());
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
    // A page and 64 words, each torn in eight ways, from three states.
    assert_eq!(cuts, 3 * 8 * (1 + 64));
}

#[test]
fn places_outside_of_the_two_pages_are_refused() {
    let mut flash = worn(0);
    let end = PAGES * PAGE;
    assert_eq!(flash.capacity(), end as usize);
    assert!(flash.erase(0, end + PAGE).is_err());
    assert!(flash.erase(4, PAGE).is_err());
    assert!(flash.write(end, &[0; 4]).is_err());
    assert!(flash.write(2, &[0; 4]).is_err());
    assert!(flash.read(end - 4, &mut [0; 8]).is_err());
    assert_eq!(flash.interface_mut().erased, [0; 4]);
    assert!(flash.interface_mut().array == Model::new().array);
}

#[test]
fn the_linkers_flash_ends_where_the_settings_begin() {
    let script = include_str!("../link/nrf52840.x");
    let kilobytes = OFFSET >> 10;
    let flash = format!("FLASH : ORIGIN = 0x00000000, LENGTH = {kilobytes}K");
    assert!(script.contains(&flash), "link/nrf52840.x does not say {flash}");
}

#[test]
fn the_page_says_how_many_saves_the_pages_stand() {
    let page = include_str!("../../../docs/microcontroller.md");
    let (_, section) = page.split_once("### nRF52840").expect("a section of its own");
    let saves = PAGES * ENDURANCE;
    let said = format!("{},{:03} saves", saves / 1_000, saves % 1_000);
    assert!(section.contains(&said), "docs/microcontroller.md does not say {said}");
}
