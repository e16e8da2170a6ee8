//! The watchdog.

use crate::mmio::Block;

/// The watchdog of Arm's Cortex-M system design kit: when it has not been fed for twice its period,
/// it restarts the board.
#[derive(Clone, Copy)]
pub struct Watchdog(Block);

impl Watchdog {
    const LOAD: usize = 0x000;
    const CONTROL: usize = 0x008;
    const CLEAR: usize = 0x00C;
    const LOCK: usize = 0xC00;
    const UNLOCK: u32 = 0x1ACC_E551;
    /// Interrupt and restart.
    const ON: u32 = 0b11;

    /// Starts it.
    pub fn start(block: Block, period_ticks: u32) -> Self {
        block.write(Self::LOCK, Self::UNLOCK);
        block.write(Self::LOAD, period_ticks);
        block.write(Self::CONTROL, Self::ON);
        Self(block)
    }

    /// Starts the period anew.
    pub fn feed(&self) {
        self.0.write(Self::CLEAR, 1);
    }
}
