//! Registration of all pairs of a list.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use echoloop_clouds::pose::read_pose;
use echoloop_clouds::{Cloud, Pose, Recorded, write_recorded};
use echoloop_registration::pair::Request;
use rayon::prelude::*;

use crate::kept::{Kept, KeptError};
use crate::list::PairFiles;
use crate::record::Record;

/// Pairs, and how to register them.
pub struct Batch<'a> {
    /// The pairs.
    pub pairs: &'a [PairFiles],
    /// Truth of each pair, instead of its file's; empty: none.
    pub truths: &'a [Pose],
    /// Settings.
    pub request: &'a Request,
    /// Metres per unit of the files of targets and of sources.
    pub scales: [f64; 2],
}

/// Records that wait for those before them.
struct InOrder<'a> {
    next: usize,
    waiting: BTreeMap<usize, Record>,
    records: Vec<Record>,
    kept: Option<&'a mut Kept>,
    told: &'a mut (dyn FnMut(&Record) + Send),
}

impl Batch<'_> {
    /// Registers the pairs on all cores. Each record is kept and told in the order of the list, as
    /// soon as those before it are done; records that are kept already are told again. A pair that
    /// cannot be read has a record that says why, and the others go on. Ends early once `stop` is
    /// set, with the records so far.
    ///
    /// # Errors
    ///
    /// [`KeptError`], when a record cannot be kept.
    pub fn run(
        &self,
        kept: Option<&mut Kept>,
        stop: &AtomicBool,
        told: &mut (dyn FnMut(&Record) + Send),
    ) -> Result<Vec<Record>, KeptError> {
        let laid = |pair: &PairFiles| kept.as_ref().map(|kept| kept.laid(&pair.name));
        // Without its laid source a pair is not done.
        let is_laid =
            |record: &Record, kept: &Kept| !record.converged || kept.laid(&record.name).exists();
        let done = |pair: &PairFiles| {
            let kept = kept.as_ref()?;
            kept.record(&pair.name).filter(|record| is_laid(record, kept)).cloned()
        };
        let work: Vec<(Option<PathBuf>, Option<Record>)> =
            self.pairs.iter().map(|pair| (laid(pair), done(pair))).collect();
        let (next, waiting, records) = (0, BTreeMap::new(), Vec::new());
        let in_order = Mutex::new(InOrder { next, waiting, records, kept, told });
        work.into_par_iter().enumerate().try_for_each(|(index, (laid, done))| {
            if stop.load(Ordering::Relaxed) {
                return Ok(());
            }
            let is_new = done.is_none();
            let record = done.unwrap_or_else(|| self.record(index, laid));
            let mut in_order = in_order.lock().unwrap_or_else(PoisonError::into_inner);
            in_order.add(index, record, is_new)
        })?;
        Ok(in_order.into_inner().unwrap_or_else(PoisonError::into_inner).records)
    }

    /// Clouds of a pair: its target and source as given, and with the source moved by a motion. Of
    /// survey coordinates, in the frame of the target's shift.
    ///
    /// # Errors
    ///
    /// The file that cannot be read, and why.
    pub fn clouds(&self, index: usize, motion: &Pose) -> Result<[[Cloud; 2]; 2], String> {
        let (target, mut source) = self.read(index, false)?;
        let given = source.cloud.clone();
        source.transform(motion);
        source.shift_by(target.shift_m);
        Ok([[target.cloud.clone(), given], [target.cloud, source.cloud]])
    }

    /// Target and source in one frame; the source with all columns, if it is to be written.
    fn read(&self, index: usize, whole: bool) -> Result<(Recorded, Recorded), String> {
        self.pairs[index].read(self.scales, whole).map_err(|error| error.to_string())
    }

    fn record(&self, index: usize, laid: Option<PathBuf>) -> Record {
        let pair = &self.pairs[index];
        let files = [&pair.target, &pair.source].map(|path| path.display().to_string());
        let [target, source] = files;
        let names = [pair.name.clone(), target, source];
        self.tried(index, laid, names.clone()).unwrap_or_else(|why| Record::untried(names, why))
    }

    fn tried(
        &self,
        index: usize,
        laid: Option<PathBuf>,
        names: [String; 3],
    ) -> Result<Record, String> {
        let pair = &self.pairs[index];
        let (target, mut source) = self.read(index, laid.is_some())?;
        let pose = |path: &PathBuf| read_pose(path).map_err(|error| error.to_string());
        let initial = pair.initial.as_ref().map(pose).transpose()?.unwrap_or_default();
        let truth = match self.truths.get(index) {
            Some(truth) => Some(*truth),
            None => pair.truth.as_ref().map(pose).transpose()?,
        };
        let found = self.request.register(&target, &source, &initial);
        let found = found.map_err(|error| error.to_string())?;
        let motion = found.target_from_source();
        let record = Record::of(names, &found.outcome, &motion, truth.as_ref());
        if let Some(path) = laid.filter(|_| record.converged) {
            source.transform(&motion);
            write_recorded(&path, &source).map_err(|error| error.to_string())?;
        }
        Ok(record)
    }
}

impl InOrder<'_> {
    fn add(&mut self, index: usize, record: Record, is_new: bool) -> Result<(), KeptError> {
        if let Some(kept) = self.kept.as_mut().filter(|_| is_new) {
            kept.add(&record)?; // at once: what is done is not done again
        }
        self.waiting.insert(index, record);
        while let Some(record) = self.waiting.remove(&self.next) {
            (self.told)(&record);
            self.records.push(record);
            self.next += 1;
        }
        Ok(())
    }
}
