//! The host's end of the link: a client, what carries its bytes, and the sensors behind it.

pub mod client;
pub mod sensor;
pub mod sensor_log;
pub mod serve;
pub mod transport;
