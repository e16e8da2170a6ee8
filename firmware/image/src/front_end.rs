//! Front end of an emulated board, behind the traits of a real one: SPI devices, a converter's
//! buffer, flash.

use echoloop_dsp::{Hardware, ScanPattern};
use echoloop_sensor::mailbox;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

use crate::mmio::Block;

/// SPI device whose registers are in the mailbox.
pub struct Device(Block);

impl mailbox::Registers for Device {
    fn get(&self, register: u8) -> u32 {
        self.0.read(usize::from(register) << 2)
    }

    fn set(&mut self, register: u8, value: u32) {
        self.0.write(usize::from(register) << 2, value);
    }
}

impl ErrorType for Device {
    type Error = ErrorKind;
}

impl SpiDevice for Device {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        mailbox::serve(self, operations)
    }
}

/// Front end in the mailbox of [`echoloop_sensor::mailbox`].
pub struct FrontEnd {
    page: Block,
    /// Laser driver.
    pub emitter: Device,
    /// Amplifier and converter.
    pub adc: Device,
    fired: u32,
}

/// Rounds, and reads per round, until a shot counts as lost. They take some seconds in an emulator,
/// because its front end is a program that may not be scheduled; a converter takes microseconds.
const SHOT_TIMEOUT: (u32, u32) = (400, 1_000_000);

impl FrontEnd {
    /// Front end in a page of memory; `None` where there is no mailbox.
    pub fn new(page: Block) -> Option<Self> {
        if page.read(0) != mailbox::MAGIC {
            return None;
        }
        let device = |offset| Device(page.part(offset, 4 * mailbox::REGISTERS));
        let (emitter, adc) = (device(mailbox::EMITTER), device(mailbox::ADC));
        Some(Self { page, emitter, adc, fired: page.read(mailbox::DOORBELL) })
    }

    /// Hardware and pattern that the board's maker set.
    pub fn straps(&self) -> Option<(Hardware, ScanPattern)> {
        let straps = self.page.part(mailbox::STRAPS, 4 * mailbox::STRAP_WORDS);
        mailbox::read_straps(core::array::from_fn(|i| straps.read(i << 2)))
    }

    /// Memory of the flash.
    pub fn flash(&self) -> Block {
        self.page.part(mailbox::FLASH, mailbox::FLASH_BYTES)
    }

    /// Rings the doorbell for the shot whose registers are written.
    pub fn ring(&mut self) {
        self.fired = self.fired.wrapping_add(1);
        publish();
        self.page.write(mailbox::DOORBELL, self.fired);
    }

    /// Waits for the last shot and copies its samples out. False when no answer came.
    ///
    /// The wait is bounded, so `waiting` may feed the watchdog meanwhile.
    pub fn samples(&mut self, codes: &mut [u16], waiting: impl Fn()) -> bool {
        let (spells, turns) = SHOT_TIMEOUT;
        let answered = (0..spells).any(|_| {
            waiting();
            (0..turns).any(|_| self.page.read(mailbox::ANSWER) == self.fired)
        });
        publish();
        if answered {
            self.page
                .part(mailbox::CODES, mailbox::FLASH.wrapping_sub(mailbox::CODES))
                .copy_halfwords(codes);
        }
        answered
    }
}

/// Orders memory accesses: those before are seen before those after.
fn publish() {
    core::sync::atomic::fence(core::sync::atomic::Ordering::SeqCst);
}
