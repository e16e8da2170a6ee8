//! Model of the flash interface of an STM32F405 and the first sectors behind it, register by
//! register (RM0090, chapter 3). Its power can fail at any moment.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use echoloop_stm32f4::flash::{Interface, Register};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Offsets of sectors 0 to 4, four of 16 KB and one of 64 KB, and their end.
const STARTS: [usize; 6] = [0, 16 << 10, 32 << 10, 48 << 10, 64 << 10, 128 << 10];
/// Size of a line of the data cache in bytes.
const LINE: usize = 16;

/// Keys that unlock the flash, one after the other.
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Bits of the registers, written once more: a model with the driver's constants would not find an
/// error in them.
mod acr {
    pub(super) const DCEN: u32 = 1 << 10;
    pub(super) const DCRST: u32 = 1 << 12;
}

mod sr {
    pub(super) const OPERATION: u32 = 1 << 1;
    pub(super) const PROTECTION: u32 = 1 << 4;
    pub(super) const ALIGNMENT: u32 = 1 << 5;
    pub(super) const PARALLELISM: u32 = 1 << 6;
    pub(super) const SEQUENCE: u32 = 1 << 7;
    /// Flags that a one clears, including the end of an operation.
    pub(super) const FLAGS: u32 = 1 | OPERATION | PROTECTION | ALIGNMENT | PARALLELISM | SEQUENCE;
    pub(super) const BSY: u32 = 1 << 16;
}

mod cr {
    pub(super) const PG: u32 = 1 << 0;
    pub(super) const SER: u32 = 1 << 1;
    /// Number of a sector.
    pub(super) const SNB: u32 = 0b1111 << 3;
    pub(super) const PSIZE: u32 = 0b11 << 8;
    /// Words of 32 bits, for which the part's voltage is high enough.
    pub(super) const PSIZE_32: u32 = 0b10 << 8;
    pub(super) const STRT: u32 = 1 << 16;
    pub(super) const LOCK: u32 = 1 << 31;
}

/// Part with the flash that a program sees.
#[derive(Clone)]
pub(crate) struct Model {
    pub(crate) array: Vec<u8>,
    /// Number of erases of each sector since it was new.
    pub(crate) erased: [u32; 5],
    /// Number of words written since it was new.
    pub(crate) written: usize,
    /// True when the flash is protected from changes.
    pub(crate) protected: bool,
    acr: u32,
    sr: u32,
    cr: u32,
    /// Number of keys given; `None` after a wrong one, when nothing unlocks the flash before the
    /// next reset.
    keys: Option<usize>,
    /// Number of reads of the status register until the operation is done.
    busy: Cell<u32>,
    cache: RefCell<BTreeMap<usize, [u8; LINE]>>,
    /// Number of words and sectors until the power fails.
    left: Option<usize>,
    off: bool,
    tear: ChaCha8Rng,
}

impl Model {
    /// Part with program and constants everywhere but in the erased sectors 1 and 2; caches are on,
    /// as the HAL's clocks leave them.
    pub(crate) fn new() -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(405);
        let mut array: Vec<u8> = (0..STARTS[5]).map(|_| rng.random()).collect();
        array[STARTS[1]..STARTS[3]].fill(0xFF);
        Self {
            array,
            erased: [0; 5],
            written: 0,
            protected: false,
            acr: 0b111 << 8 | 5,
            sr: 0,
            cr: cr::LOCK,
            keys: Some(0),
            busy: Cell::new(0),
            cache: RefCell::default(),
            left: None,
            off: false,
            tear: rng,
        }
    }

    /// Lets the power fail after this many more words and sectors, in the middle of the next.
    pub(crate) fn cut_after(&mut self, steps: usize, seed: u64) {
        self.left = Some(steps);
        self.tear = ChaCha8Rng::seed_from_u64(seed);
    }

    /// Switches the power on for good.
    pub(crate) fn switch_on(&mut self) {
        (self.left, self.off) = (None, false);
        (self.sr, self.cr, self.keys) = (0, cr::LOCK, Some(0));
        self.busy.set(0);
        self.cache.borrow_mut().clear();
    }

    pub(crate) fn is_locked(&self) -> bool {
        self.cr & cr::LOCK != 0
    }

    /// Writes a wrong key, as an earlier program may have done.
    pub(crate) fn jam(&mut self) {
        self.set(Register::Keyr, 1);
    }

    /// Sets an error that another operation left behind.
    pub(crate) fn leave_error(&mut self) {
        self.sr |= sr::SEQUENCE;
    }

    /// Begins a word or a sector: true when it is done whole, false when it is torn.
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

    fn open(&mut self, key: u32) {
        assert!(self.is_locked(), "a key for an open door");
        self.keys = self.keys.filter(|&given| key == KEYS[given]).map(|given| given + 1);
        if self.keys == Some(KEYS.len()) {
            (self.cr, self.keys) = (self.cr & !cr::LOCK, Some(0));
        }
    }

    fn control(&mut self, value: u32) {
        assert_eq!(self.busy.get(), 0, "the control register was written while the flash was busy");
        if self.is_locked() {
            return;
        }
        let (before, begins) = (self.cr, value & cr::STRT != 0);
        self.cr = value & !cr::STRT;
        if begins && value & cr::SER != 0 {
            assert_eq!(before & cr::SNB, value & cr::SNB, "sector and start in one write");
            self.erase(((value & cr::SNB) >> 3) as usize);
        }
    }

    fn erase(&mut self, number: usize) {
        if self.protected {
            self.sr |= sr::PROTECTION;
            return;
        }
        assert!(number < self.erased.len(), "sector {number} is not modelled");
        let whole = self.step();
        for byte in &mut self.array[STARTS[number]..STARTS[number + 1]] {
            *byte |= if whole { 0xFF } else { self.tear.next_u32() as u8 };
        }
        self.erased[number] += 1;
    }

    fn stored(&self, at: usize) -> [u8; 4] {
        self.array[at..at + 4].try_into().expect("four bytes")
    }
}

impl Interface for Model {
    fn get(&self, register: Register) -> u32 {
        match register {
            Register::Acr => self.acr,
            Register::Keyr => 0,
            Register::Cr => self.cr,
            // A program without power reads nothing; this value lets the driver end.
            Register::Sr if self.off => sr::OPERATION,
            Register::Sr => {
                let busy = self.busy.get();
                self.busy.set(busy.saturating_sub(1));
                self.sr | if busy > 0 { sr::BSY } else { 0 }
            }
        }
    }

    fn set(&mut self, register: Register, value: u32) {
        if self.off {
            return;
        }
        match register {
            Register::Acr => {
                let empties = value & acr::DCRST != 0;
                assert!(!empties || self.acr & acr::DCEN == 0, "emptied while it is on");
                if empties {
                    self.cache.borrow_mut().clear();
                }
                self.acr = value;
            }
            Register::Keyr => self.open(value),
            Register::Sr => self.sr &= !(value & sr::FLAGS),
            Register::Cr => self.control(value),
        }
    }

    fn word(&self, offset: u32) -> u32 {
        assert_eq!(self.busy.get(), 0, "the array was read while the flash was busy");
        let at = offset as usize;
        if self.acr & acr::DCEN == 0 {
            return u32::from_le_bytes(self.stored(at));
        }
        let from = at / LINE * LINE;
        let mut cache = self.cache.borrow_mut();
        let line = cache
            .entry(from)
            .or_insert_with(|| self.array[from..from + LINE].try_into().expect("a line"));
        u32::from_le_bytes(line[at - from..][..4].try_into().expect("four bytes"))
    }

    fn set_word(&mut self, offset: u32, word: u32) {
        assert_eq!(self.busy.get(), 0, "the array was written while the flash was busy");
        let wrong = [
            (self.is_locked() || self.cr & cr::PG == 0, sr::SEQUENCE),
            (self.cr & cr::PSIZE != cr::PSIZE_32, sr::PARALLELISM),
            (!offset.is_multiple_of(4), sr::ALIGNMENT),
            (self.protected, sr::PROTECTION),
        ];
        let errors: u32 = wrong.iter().map(|&(is, error)| if is { error } else { 0 }).sum();
        if self.off || errors != 0 {
            self.sr |= errors;
            return;
        }
        let old = u32::from_le_bytes(self.stored(offset as usize));
        let torn = if self.step() { 0 } else { self.tear.next_u32() };
        let new = old & (word | torn);
        self.array[offset as usize..][..4].copy_from_slice(&new.to_le_bytes());
        self.written += 1;
    }
}
