//! The watchdog, and what survives it.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

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

/// Words that neither start-up nor a restart touches.
#[repr(transparent)]
struct Survivors(UnsafeCell<MaybeUninit<[u32; 2]>>);

// SAFETY: only `count_restarts` touches it, once, before anything else runs; there is one core.
unsafe impl Sync for Survivors {}

#[unsafe(link_section = ".uninit.restarts")]
static SURVIVORS: Survivors = Survivors(UnsafeCell::new(MaybeUninit::uninit()));

/// Says that the second word counts.
const COUNTING: u32 = 0x5741_5443;

/// Restarts since the power came on, this start included when it is one. To be called once.
pub fn count_restarts() -> u32 {
    let words = SURVIVORS.0.get().cast::<u32>();
    // SAFETY: two aligned words of a static that nothing else accesses; volatile, so that whatever
    // they hold is a value.
    unsafe {
        let restarts = match words.read_volatile() {
            COUNTING => words.add(1).read_volatile().wrapping_add(1),
            _ => 0,
        };
        words.write_volatile(COUNTING);
        words.add(1).write_volatile(restarts);
        restarts
    }
}
