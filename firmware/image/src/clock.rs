//! Clock of microseconds, from a counter of ticks.

use crate::mmio::Block;

/// Counter of ticks: one word that counts up or down through all 32 bits.
#[derive(Clone, Copy)]
pub struct Counter {
    block: Block,
    offset: usize,
    down: bool,
    ticks_per_us: u32,
}

impl Counter {
    /// Counter of a word that counts up.
    pub const fn up(block: Block, offset: usize, ticks_per_us: u32) -> Self {
        Self { block, offset, down: false, ticks_per_us }
    }

    /// Starts a timer of Arm's Cortex-M system design kit, which counts down.
    pub fn start_cmsdk(block: Block, ticks_per_us: u32) -> Self {
        const CONTROL: usize = 0x00;
        const VALUE: usize = 0x04;
        const RELOAD: usize = 0x08;
        const ON: u32 = 1;
        block.write(RELOAD, u32::MAX);
        block.write(VALUE, u32::MAX);
        block.write(CONTROL, ON);
        Self { block, offset: VALUE, down: true, ticks_per_us }
    }

    fn ticks(&self) -> u32 {
        let word = self.block.read(self.offset);
        if self.down { !word } else { word }
    }
}

/// Clock of microseconds. It must be read before the counter has gone round: 171 s at 25 MHz.
pub struct Clock {
    counter: Counter,
    ticks: u32,
    /// Ticks that are not a whole microsecond yet.
    rest: u32,
    us: u32,
}

impl Clock {
    /// Clock that begins at 0.
    pub fn new(counter: Counter) -> Self {
        Self { ticks: counter.ticks(), counter, rest: 0, us: 0 }
    }

    /// Microseconds since the clock began, wrapping.
    pub fn now_us(&mut self) -> u32 {
        let ticks = self.counter.ticks();
        let since = ticks.wrapping_sub(self.ticks).saturating_add(self.rest);
        self.ticks = ticks;
        let per_us = self.counter.ticks_per_us;
        self.rest = since.checked_rem(per_us).unwrap_or(0);
        self.us = self.us.wrapping_add(since.checked_div(per_us).unwrap_or(0));
        self.us
    }
}
