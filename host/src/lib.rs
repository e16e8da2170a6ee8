//! Echoloop on the host: the waveform front end, registration, the optimiser, experiments and the command line.

pub mod cli;
pub mod client;
pub mod cloud;
pub mod config;
pub mod dataset;
pub mod evaluate;
pub mod frontend;
pub mod journal;
pub mod objective;
pub mod optimize;
pub mod params;
pub mod pose;
pub mod registration;
pub mod report;
pub mod run;
pub mod seed;
pub mod sensor;
pub mod sensor_log;
pub mod serve;
pub mod transport;
pub mod tune;
pub mod waveforms;
