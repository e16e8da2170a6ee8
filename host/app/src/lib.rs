//! Echoloop on the host: experiments, the link to a sensor, reports and the command line.
//!
//! | room | what it is for |
//! |---|---|
//! | [`report`] | a run as one HTML page: plain data in, a string out |
//! | [`desk`] | runs that are over: read back from their folders, told, compared |
//! | [`reproduce`] | the paper's table: its cells, what is kept of them, the table made of it |
//! | [`cli`] | the program `echoloop` |
//!
//! `cli` uses all others, `desk` uses `experiment` and `report`,
//! `reproduce` all three. Each room's page begins with its recipe.

pub mod cli;
pub mod desk;
pub mod report;
pub mod reproduce;
