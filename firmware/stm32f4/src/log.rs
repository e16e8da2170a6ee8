//! Log on RTT and USART2.

use echoloop_part::log::Log;
use stm32f4xx_hal::pac::USART2;

use crate::link::Sender;

/// Log to both.
pub(crate) static LOG: Log<Sender<USART2>> = Log::new();

echoloop_part::logger!(LOG);
