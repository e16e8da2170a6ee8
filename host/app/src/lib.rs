//! Echoloop on the host: experiments, the link to a sensor, reports and the command line.
//!
//! | room | what it is for |
//! |---|---|
//! | [`reproduce`] | the paper's table: its cells, what is kept of them, the table made of it |
//! | [`cli`] | the program `echoloop` |
//!
//! `cli` uses all others, `desk` uses `experiment` and `report`,
//! `reproduce` all three. Each room's page begins with its recipe.

pub mod cli;
