//! The host's end of the link: a client, what carries its bytes, and the sensors behind it.
//!
//! To speak to a sensor: take a [`transport`] for its line, give it to [`client::Client::connect`],
//! then `configure` and `scan`. [`sensor::Sensors`] holds many of them, whichever kind
//! `--sensor` names, and lends one to each thread; [`serve`] is the other end of a serial line.
//! To carry the bytes in a new way, implement [`transport::Transport`]: it may lose, change and
//! delay them.
//!
//! ```
//! use echoloop_dsp::Settings;
//! use echoloop_host::experiment::config::RunConfig;
//! use echoloop_host::link::client::{Client, RetryPolicy};
//! use echoloop_host::link::sensor::Model;
//! use echoloop_host::link::transport::InProcess;
//! use echoloop_sim::board::PcSensor;
//!
//! let mut config = RunConfig::default();
//! (config.scanner.columns, config.scanner.rows) = (Some(24), Some(8));
//! let model = Model::from(&config);
//! let sensor = PcSensor::new(model.front_end(), model.pattern, model.hardware);
//! let mut client = Client::connect(InProcess(sensor), RetryPolicy::default())?;
//! client.configure(&Settings { power_uw: 20_000_000, ..Settings::default() })?;
//! let beams = client.scan(1)?;
//! assert_eq!(beams.len(), 24 * 8);
//! assert!(beams.iter().all(|echoes| echoes.is_empty()), "there is nothing to see");
//! # Ok::<(), echoloop_host::link::client::ClientError>(())
//! ```

pub mod client;
pub mod defmt_log;
pub mod pattern;
pub mod sensor;
pub mod serve;
pub mod size;
pub mod transport;
