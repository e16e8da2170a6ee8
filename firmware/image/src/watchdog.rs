//! The watchdog, and what survives it.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

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

// SAFETY: only `count_restarts` touches it, and only its first call; there is one core, and no
// handler runs.
unsafe impl Sync for Survivors {}

#[unsafe(link_section = ".uninit.restarts")]
static SURVIVORS: Survivors = Survivors(UnsafeCell::new(MaybeUninit::uninit()));

/// Says that the second word counts.
const COUNTING: u32 = 0x5741_5443;

/// Whether this start has been counted.
static COUNTED: AtomicBool = AtomicBool::new(false);

/// Restarts since the power came on, this start included when it is one; `None` on later calls.
pub fn count_restarts() -> Option<u32> {
    // A load and a store: a Cortex-M0 has no swap, and nothing comes in between.
    if COUNTED.load(Ordering::Relaxed) {
        return None;
    }
    COUNTED.store(true, Ordering::Relaxed);
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
        Some(restarts)
    }
}
