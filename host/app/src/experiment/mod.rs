//! What a run is: its configuration, its pairs of scans, the search and the judgement.
//!
//! 1. [`config::load`] makes a [`config::RunConfig`] from a file and single values.
//! 2. [`dataset::Dataset::build_with_check`] traces every scan of every pair.
//! 3. [`objective::Bench`] puts pairs and sensors together. What it measures is f_opt of Eq. 4: two
//!    scans through the sensor's link, a registration, an error.
//! 4. [`params::Space`] is the cube that a search moves in; [`tune::TuneSearch::run`] searches it,
//!    writing each generation to a [`journal::Journal`].
//! 5. [`tune::TuneSearch::judge`] says what parameters are worth on pairs that no search saw.
//!
//! A new parameter of the sensor is a row of the firmware's table
//! (`firmware/dsp/src/settings/parameters.rs`), one of a method a row of
//! `host/registration/src/config/table.rs`; both then are axes of the cube. A new key
//! of a configuration is a row of its section in [`config`], and [`explained::explained`] then says what it is.
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use echoloop_host::experiment::config::load;
//! use echoloop_host::experiment::dataset::Dataset;
//! use echoloop_host::experiment::journal::Journal;
//! use echoloop_host::experiment::objective::Bench;
//! use echoloop_host::experiment::params::{Parameters, Space};
//! use echoloop_host::experiment::tune::{Silent, TuneSearch};
//! use echoloop_host::link::sensor::{Model, Sensors};
//!
//! let small = [
//!     "scene.towns=[1]", "scanner.columns=24", "scanner.rows=8", "data.train_pairs=1",
//!     "data.test_pairs=1", "tune.generations=2", "tune.population=3", "tune.shortlist=1",
//! ];
//! let overrides: Result<Vec<_>, _> = small.iter().map(|text| text.parse()).collect();
//! let config = load(None, &overrides?)?;
//! let (tune, hardware) = (&config.tune, config.hardware());
//! let start = Parameters::start(&config, &hardware)?;
//! let dataset = Dataset::build_with_check(&config, &|_, _| ())?;
//! let sensors = Sensors::in_process(Model::from(&config));
//! let search = TuneSearch {
//!     config: &config,
//!     bench: Bench { dataset: &dataset, sensors: &sensors },
//!     space: Space::new(tune.protocol, tune.lidar, config.registration.preset, start, hardware),
//!     start,
//!     warm_starts: Vec::new(),
//!     stop: &AtomicBool::new(false),
//! };
//! let folder = tempfile::tempdir()?;
//! let mut journal = Journal::create(&folder.path().join("history.jsonl"), &search.header())?;
//! let tuned = search.run(&mut journal, Vec::new(), &Silent)?;
//! // The sensor, registration, both; before both the sensor again, had registration moved.
//! assert_eq!(tuned.generations.len(), 2 + 2 + 1);
//! let before = search.judge(&start, &Silent)?;
//! let after = search.judge(&tuned.parameters, &Silent)?;
//! println!("recall {:.0} % before, {:.0} % after", before.recall_pct, after.recall_pct);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod about;
pub mod beam_list;
pub mod beams;
pub mod checksum;
pub mod compare;
pub mod config;
pub mod content;
pub mod cost;
pub mod dataset;
pub mod evaluate;
pub mod explained;
pub mod files;
pub mod front;
pub mod gain;
pub mod journal;
pub mod objective;
pub mod params;
pub mod preset;
pub mod run;
pub mod scan_cloud;
pub mod seed;
pub mod source;
pub mod survey;
pub mod tune;
pub mod written;
