//! Log on RTT and USART2.

use echoloop_part::log::Log;
use stm32f4xx_hal::pac::USART2;

use crate::link::Sender;

/// Log to both.
pub(crate) static LOG: Log<Sender<USART2>> = Log::new();

defmt::timestamp!("{=u32}", echoloop_part::log::number());

#[defmt::global_logger]
struct Logger;

// SAFETY: each call goes to the log, which is consistent between `acquire` and `release`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: defmt is the caller.
        unsafe { LOG.acquire() };
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: defmt is the caller.
        unsafe { LOG.release() };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: defmt is the caller.
        unsafe { LOG.write(bytes) };
    }
}
