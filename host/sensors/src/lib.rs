//! The host's end of the link: a client, what carries its bytes, and the sensors behind it.
//!
//! To speak to a sensor: take a [`transport`] for its line, give it to [`client::Client::connect`],
//! then `configure` and `scan`. [`sensor::Sensors`] holds many of them, whichever kind
//! `--sensor` names, and lends one to each thread; [`serve`] is the other end of a serial line.
//! To carry the bytes in a new way, implement [`transport::Transport`]: it may lose, change and
//! delay them.
//!
//! ```
//! use echoloop_dsp::scan_pattern::Grid;
//! use echoloop_dsp::{ScanPattern, Settings};
//! use echoloop_frontend::Receiver;
//! use echoloop_sensors::boards::pc::PcSensor;
//! use echoloop_sensors::client::{Client, RetryPolicy};
//! use echoloop_sensors::sensor::Model;
//! use echoloop_sensors::transport::InProcess;
//!
//! let pattern = ScanPattern::Grid(Grid { columns: 24, rows: 8, ..Grid::default() });
//! let model = Model::new(Receiver::default(), pattern);
//! let sensor = PcSensor::new(model.front_end(), model.pattern, model.hardware);
//! let mut client = Client::connect(InProcess(sensor), RetryPolicy::default())?;
//! client.configure(&Settings { power_uw: 20_000_000, ..Settings::default() })?;
//! let beams = client.scan(1)?;
//! assert_eq!(beams.len(), 24 * 8);
//! assert!(beams.iter().all(|echoes| echoes.is_empty()), "there is nothing to see");
//! # Ok::<(), echoloop_sensors::client::ClientError>(())
//! ```

pub mod boards;
pub mod client;
pub mod defmt_log;
pub mod pattern;
pub mod sensor;
pub mod serve;
pub mod size;
pub mod transport;
pub mod wording;
