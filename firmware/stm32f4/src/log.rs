//! The log: RTT, and USART2.

use echoloop_part::log::Log;
use stm32f4xx_hal::pac::USART2;

use crate::link::Sender;

/// Both ways out.
pub(crate) static LOG: Log<Sender<USART2>> = Log::new();

defmt::timestamp!("{=u32}", echoloop_part::log::number());

#[defmt::global_logger]
struct Logger;

// SAFETY: each is the log's own, which is whole between `acquire` and `release`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: defmt calls.
        unsafe { LOG.acquire() };
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: defmt calls.
        unsafe { LOG.release() };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: defmt calls.
        unsafe { LOG.write(bytes) };
    }
}
