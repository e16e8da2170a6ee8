//! Echoloop on the host: the waveform front end, registration, the optimiser, experiments and the command line.

pub mod client;
pub mod cloud;
pub mod frontend;
pub mod optimize;
pub mod pose;
pub mod registration;
pub mod report;
pub mod seed;
pub mod transport;
