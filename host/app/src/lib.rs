//! Echoloop on the host: experiments, the link to a sensor, reports and the command line.

pub mod cli;
pub mod experiment;
pub mod link;
pub mod report;
pub mod waveforms;
