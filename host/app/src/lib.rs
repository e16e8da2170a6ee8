//! Echoloop on the host: experiments, the link to a sensor, reports and the command line.
//!
//! | room | what it is for |
//! |---|---|
//! | [`experiment`] | configuration, pairs of scans, the search, the judgement |
//! | [`link`] | the client of a sensor, what carries its bytes, the sensors behind it |
//! | [`waveforms`] | echoes in what other instruments recorded |
//! | [`report`] | a run as one HTML page: plain data in, a string out |
//! | [`cli`] | the program `echoloop` |
//!
//! `cli` uses all others, `experiment` uses `link`. Each room's page begins with its recipe.

pub mod cli;
pub mod experiment;
pub mod link;
pub mod report;
mod said;
pub mod waveforms;

pub use said::say;
