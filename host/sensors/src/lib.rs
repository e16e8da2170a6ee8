//! Host's end of the link: a client, transports for its bytes, and the sensors behind them.
//!
//! To use a sensor: open a [`transport`] for its line, give it to [`client::Client::connect`], then
//! `configure` and `scan`. [`sensor::Sensors`] is a pool of sensors of the kind that `--sensor`
//! names, one for each thread; [`serve`] is the other end of a serial line. A new transport
//! implements [`transport::Transport`]: it may lose, change and delay bytes.
//!
//! ```
//! use echoloop_dsp::scan_pattern::grid::Grid;
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
