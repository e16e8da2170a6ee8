//! The closed loop: configuration, pairs of scans, the search, the evaluation.
//!
//! 1. [`config::load`] makes a [`config::RunConfig`] from a file and single values.
//! 2. [`dataset::Dataset::build_with_check`] traces every scan of every pair.
//! 3. [`evaluation::objective::Bench`] puts pairs and sensors together and evaluates f_opt of Eq.
//!    4: two scans through the sensor's link, a registration, an error.
//! 4. [`parameters::Space`] is the unit cube of the search. [`search::TuneSearch::run`] searches it
//!    and writes each generation to a [`run_folder::journal::Journal`].
//! 5. [`search::TuneSearch::judge`] evaluates parameters on pairs that no search saw.
//!
//! [`prepared`] does steps 2 to 4 for a configuration and a sensor, [`tuning`] step 5 and the files
//! of a run.
//!
//! A new parameter of the sensor is a row of `firmware/dsp/src/settings/parameters.rs`, one of a
//! method a row of `host/registration/src/config/table.rs`; both then are axes of the cube. A new
//! key of a configuration is a row of its section in [`config`];
//! [`config::key_reference::explained`] then explains it.
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use echoloop_closed_loop::config::load;
//! use echoloop_closed_loop::dataset::Dataset;
//! use echoloop_closed_loop::run_folder::journal::Journal;
//! use echoloop_closed_loop::evaluation::objective::Bench;
//! use echoloop_closed_loop::parameters::{Parameters, Space};
//! use echoloop_closed_loop::search::{Silent, TuneSearch};
//! use echoloop_sensors::sensor::{Model, Sensors};
//!
//! let small = [
//!     "scene.source=structured", "scene.towns=[1]", "scanner.pattern=grid", "scanner.columns=24",
//!     "scanner.rows=8", "data.train_pairs=1", "data.test_pairs=1", "tune.generations=3",
//!     "tune.population=3", "tune.shortlist=1",
//! ];
//! let overrides: Result<Vec<_>, _> = small.iter().map(|text| text.parse()).collect();
//! let config = load(None, &overrides?)?;
//! let (tune, device) = (&config.tune, config.device());
//! let start = Parameters::start(&config, &device)?;
//! let dataset = Dataset::build_with_check(&config, &|_, _| ())?;
//! let sensors = Sensors::in_process(Model::from(&config));
//! let search = TuneSearch {
//!     config: &config,
//!     bench: Bench { dataset: &dataset, sensors: &sensors },
//!     space: Space::new(tune.protocol, tune.lidar, config.registration.preset, start, device),
//!     start,
//!     warm_starts: Vec::new(),
//!     stop: &AtomicBool::new(false),
//!     elsewhere: None,
//! };
//! let folder = tempfile::tempdir()?;
//! let mut journal = Journal::create(&folder.path().join("history.jsonl"), &search.header())?;
//! let tuned = search.run(&mut journal, Vec::new(), &Silent)?;
//! // The sensor beside registration, each again, registration, both.
//! assert_eq!(tuned.generations.len(), 2 + 2 + 1 + 1 + 1 + 1);
//! let before = search.judge(&start, &Silent)?;
//! let after = search.judge(&tuned.parameters, &Silent)?;
//! println!("recall {:.0} % before, {:.0} % after", before.recall_pct, after.recall_pct);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod ask_tell;
pub mod beams;
pub mod budget;
pub mod checksum;
pub mod config;
pub mod cost;
pub mod dataset;
pub mod evaluation;
pub mod external_search;
pub mod front;
pub mod parameters;
pub mod prepared;
pub mod run_folder;
pub mod scan_folder;
pub mod search;
pub mod seed;
pub mod tuning;
pub mod written;
