//! Watchdog of the emulated Arm boards.

use crate::mmio::Block;

/// Watchdog of Arm's Cortex-M system design kit. It restarts the board when it has not been fed for
/// two periods.
#[derive(Clone, Copy)]
pub struct Watchdog(Block);

impl Watchdog {
    const LOAD: usize = 0x000;
    const CONTROL: usize = 0x008;
    const CLEAR: usize = 0x00C;
    const LOCK: usize = 0xC00;
    const UNLOCK: u32 = 0x1ACC_E551;
    /// Value of CONTROL: interrupt and restart are on.
    const ON: u32 = 0b11;

    /// Starts the watchdog.
    pub fn start(block: Block, period_ticks: u32) -> Self {
        block.write(Self::LOCK, Self::UNLOCK);
        block.write(Self::LOAD, period_ticks);
        block.write(Self::CONTROL, Self::ON);
        Self(block)
    }

    /// Restarts the period.
    pub fn feed(&self) {
        self.0.write(Self::CLEAR, 1);
    }
}
