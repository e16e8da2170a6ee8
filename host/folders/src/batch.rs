//! Registration of all pairs of a list.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::{fs, io};

use echoloop_clouds::pose::read_pose;
use echoloop_clouds::{Cloud, Pose, Recorded, write_recorded};
use echoloop_registration::pair::Request;

use crate::kept::{Inputs, Kept, KeptError};
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

/// What is to be done with a pair that a folder is kept of.
#[derive(Default)]
struct Work {
    /// Where its source is to be laid.
    laid: Option<PathBuf>,
    /// True when another record's source may lie there.
    has_old: bool,
    done: Option<Record>,
}

/// A record, and what it is to be kept with; none when it is kept already.
struct Made {
    record: Record,
    inputs: Option<Option<Inputs>>,
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
    /// soon as those before it are done; records that are kept already are told again, judged by
    /// the truth as it is now. A pair that cannot be read has a record that says why, and the
    /// others go on. Once `stop` is set no pair is begun, and the records are all that are done.
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
        let of_kept = |pair: &PairFiles, kept: &Kept| Work {
            laid: Some(kept.laid(&pair.name)),
            has_old: kept.has_laid(&pair.name),
            done: kept.record(pair).cloned(),
        };
        let work = |pair| kept.as_ref().map(|kept| of_kept(pair, kept)).unwrap_or_default();
        let work: Vec<Work> = self.pairs.iter().map(work).collect();
        let (next, waiting, records) = (0, BTreeMap::new(), Vec::new());
        let in_order = Mutex::new(InOrder { next, waiting, records, kept, told });
        // Handed out one by one: halves of the list would end with half of it waiting.
        let handed_out = AtomicUsize::new(0);
        let has_failed = AtomicBool::new(false);
        let on_each_thread = || loop {
            let index = handed_out.fetch_add(1, Ordering::Relaxed);
            let Some(work) = work.get(index).filter(|_| !has_failed.load(Ordering::Relaxed)) else {
                return Ok(());
            };
            if work.done.is_none() && stop.load(Ordering::Relaxed) {
                continue; // what is done already is told all the same
            }
            let made = self.make(index, work);
            let mut in_order = in_order.lock().unwrap_or_else(PoisonError::into_inner);
            in_order.add(index, made).inspect_err(|_| has_failed.store(true, Ordering::Relaxed))?;
        };
        let ended: Result<(), KeptError> =
            rayon::broadcast(|_| on_each_thread()).into_iter().collect();
        ended?;
        Ok(in_order.into_inner().unwrap_or_else(PoisonError::into_inner).end())
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
        self.pairs[index].read(self.scales, whole)
    }

    fn make(&self, index: usize, work: &Work) -> Made {
        let pair = &self.pairs[index];
        let [target, source] = [&pair.target, &pair.source].map(|path| path.display().to_string());
        let names = [pair.name.clone(), target, source];
        // Before they are read: files that change meanwhile are done again.
        let inputs = work.done.is_none().then(|| Inputs::of(pair));
        let tried = pair.check().and_then(|()| self.truth(index)).and_then(|truth| {
            let record = match &work.done {
                Some(done) => done.clone().named(names.clone()),
                None => self.tried(index, work.laid.as_deref(), work.has_old, names.clone())?,
            };
            Ok(record.judged(truth.as_ref()))
        });
        Made { record: tried.unwrap_or_else(|why| Record::untried(names, why)), inputs }
    }

    fn truth(&self, index: usize) -> Result<Option<Pose>, String> {
        match self.truths.get(index) {
            Some(truth) => Ok(Some(*truth)),
            None => self.pairs[index].truth.as_deref().map(pose).transpose(),
        }
    }

    fn tried(
        &self,
        index: usize,
        laid: Option<&Path>,
        has_old: bool,
        names: [String; 3],
    ) -> Result<Record, String> {
        // Of files that are no more: it would lie beside a record that it is not of.
        laid.filter(|_| has_old).map_or(Ok(()), remove)?;
        let (target, mut source) = self.read(index, laid.is_some())?;
        let initial = self.pairs[index].initial.as_deref().map(pose).transpose()?;
        let found = self.request.register(&target, &source, &initial.unwrap_or_default());
        let found = found.map_err(|error| error.to_string())?;
        let motion = found.target_from_source();
        let record = Record::of(names, &found.outcome, &motion);
        if let Some(path) = laid.filter(|_| record.converged) {
            source.transform(&motion);
            write_recorded(path, &source).map_err(|error| error.to_string())?;
        }
        Ok(record)
    }
}

fn pose(path: &Path) -> Result<Pose, String> {
    read_pose(path).map_err(|error| error.to_string())
}

/// Removes a file, if it is there.
fn remove(path: &Path) -> Result<(), String> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(format!("{}: {error}", path.display()))
        }
        _ => Ok(()),
    }
}

impl InOrder<'_> {
    fn add(&mut self, index: usize, Made { record, inputs }: Made) -> Result<(), KeptError> {
        if let Some((kept, inputs)) = self.kept.as_mut().zip(inputs) {
            kept.add(&record, inputs)?; // at once: what is done is not done again
        }
        self.waiting.insert(index, record);
        while let Some(record) = self.waiting.remove(&self.next) {
            self.tell(record);
            self.next += 1;
        }
        Ok(())
    }

    fn tell(&mut self, record: Record) {
        (self.told)(&record);
        self.records.push(record);
    }

    /// Tells those that waited for pairs that are left out.
    fn end(mut self) -> Vec<Record> {
        let waiting = std::mem::take(&mut self.waiting);
        waiting.into_values().for_each(|record| self.tell(record));
        self.records
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::fs::File;
    use std::time::{Duration, UNIX_EPOCH};

    use echoloop_registration::Method;
    use tempfile::TempDir;

    use super::*;

    fn request() -> Request {
        let mut request = Request { method: Method::Icp, unchecked: true, ..Request::default() };
        for (key, value) in
            [("voxel_m", 0.5), ("translation_tolerance_m", 5e-3), ("rotation_tolerance_rad", 5e-3)]
        {
            request.given.set(key, value).unwrap();
        }
        request
    }

    /// Writes a wavy field, moved by -`x_m`, as a scan that is `x_m` ahead sees it.
    fn scan(folder: &Path, name: &str, x_m: f32) {
        let at = |i: i32| {
            let [x, y] = [i % 50 - 25, i / 50 - 25].map(|k| k as f32 * 0.4);
            format!("{} {y} {}\n", x - x_m, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos())
        };
        fs::create_dir_all(folder).unwrap();
        fs::write(folder.join(name), (0..2500).map(at).collect::<String>()).unwrap();
    }

    /// A folder of pairs whose sources are this far ahead, m.
    fn folder(at: &Path, ahead_m: &[(&str, f32)]) -> PathBuf {
        for (name, x_m) in ahead_m {
            scan(at, &format!("{name}_target.xyz"), 0.0);
            scan(at, &format!("{name}_source.xyz"), *x_m);
        }
        at.to_owned()
    }

    fn ahead_m(record: &Record) -> f64 {
        record.motion().unwrap().translation.vector.x
    }

    /// Registers pairs; x of each motion, m, and number of lines that the folder has then.
    fn run(pairs: &[PairFiles], done: &Path) -> (Vec<Record>, usize) {
        let request = request();
        let batch = Batch { pairs, truths: &[], request: &request, scales: [1.0; 2] };
        let mut kept = Kept::open(done, "settings").unwrap();
        let records = batch.run(Some(&mut kept), &AtomicBool::new(false), &mut |_| ()).unwrap();
        let lines = fs::read_to_string(done.join("registered.jsonl")).unwrap().lines().count();
        (records, lines - 1)
    }

    fn registered(from: &Path, done: &Path) -> (Vec<Record>, usize) {
        run(&PairFiles::list(from).unwrap(), done)
    }

    fn assert_near(records: &[Record], expected_m: &[f64]) {
        let found_m: Vec<f64> = records.iter().map(ahead_m).collect();
        let near = found_m.iter().zip(expected_m).all(|(a, b)| (a - b).abs() < 0.02);
        assert!(near && found_m.len() == expected_m.len(), "{found_m:?} for {expected_m:?}");
    }

    #[test]
    fn pairs_of_the_same_names_in_another_folder_are_done_anew() {
        let home = TempDir::new().unwrap();
        let [a, b, done] = ["a", "b", "done"].map(|name| home.path().join(name));
        folder(&a, &[("x", 0.3), ("y", 0.3)]);
        folder(&b, &[("x", 0.6), ("y", 0.6)]);
        let (records, lines) = registered(&a, &done);
        assert_near(&records, &[0.3; 2]);
        assert_eq!((registered(&a, &done), lines), ((records, 2), 2), "done once");
        let of_a = fs::read(done.join("x.ply")).unwrap();
        let (records, lines) = registered(&b, &done);
        assert_near(&records, &[0.6; 2]);
        assert!(records[0].source.ends_with("b/x_source.xyz") && lines == 4, "{lines}");
        assert_ne!(fs::read(done.join("x.ply")).unwrap(), of_a);
        // The folder's sources are those of its last lines, so the first pairs are to do again.
        let (records, lines) = registered(&a, &done);
        assert_near(&records, &[0.3; 2]);
        assert_eq!((fs::read(done.join("x.ply")).unwrap(), lines), (of_a, 6));
    }

    #[test]
    fn a_pair_whose_files_have_changed_is_done_anew() {
        let home = TempDir::new().unwrap();
        let done = home.path().join("done");
        let from = folder(&home.path().join("a"), &[("x", 0.3), ("y", 0.3)]);
        assert_eq!(registered(&from, &done).1, 2);
        scan(&from, "x_source.xyz", 0.6);
        let (records, lines) = registered(&from, &done);
        assert_near(&records, &[0.6, 0.3]);
        assert_eq!(lines, 3);
        // Of the same size, at another time.
        let late = UNIX_EPOCH + Duration::from_secs(4_000_000_000);
        let target = File::options().write(true).open(from.join("y_target.xyz")).unwrap();
        target.set_modified(late).unwrap();
        assert_eq!(registered(&from, &done).1, 4);
        let guess = |x_m: f64| format!("1 0 0 {x_m} 0 1 0 0 0 0 1 0\n");
        for (x_m, expected) in [(0.2, 5), (0.25, 6)] {
            fs::write(from.join("x_initial.txt"), guess(x_m)).unwrap();
            assert_eq!(registered(&from, &done).1, expected, "a guess of {x_m} m");
        }
        fs::remove_file(from.join("x_initial.txt")).unwrap();
        assert_eq!((registered(&from, &done).1, registered(&from, &done).1), (7, 7));
    }

    #[test]
    fn a_source_that_an_earlier_record_laid_is_gone_with_it() {
        let home = TempDir::new().unwrap();
        let done = home.path().join("done");
        let from = folder(&home.path().join("a"), &[("x", 0.3)]);
        registered(&from, &done);
        assert!(done.join("x.ply").exists());
        fs::write(from.join("x_source.xyz"), "1 0 0\n").unwrap();
        let (records, _) = registered(&from, &done);
        assert!(!records[0].converged && !done.join("x.ply").exists(), "{}", records[0].stop);
    }

    #[test]
    fn a_scan_between_two_others_is_the_target_of_the_later_one() {
        let home = TempDir::new().unwrap();
        let (drive, done) = (home.path().join("drive"), home.path().join("done"));
        let consecutive = || PairFiles::consecutive(&drive).unwrap();
        [("1.xyz", 0.0), ("3.xyz", 0.6)].iter().for_each(|(name, x)| scan(&drive, name, *x));
        assert_near(&run(&consecutive(), &done).0, &[0.6]);
        scan(&drive, "2.xyz", 0.4);
        assert_near(&run(&consecutive(), &done).0, &[0.4, 0.2]);
    }

    #[test]
    fn a_truth_counts_as_it_is_when_a_record_is_told_again() {
        let home = TempDir::new().unwrap();
        let done = home.path().join("done");
        let from = folder(&home.path().join("a"), &[("x", 0.3)]);
        let error_m = |text: Option<&str>| {
            let truth = from.join("x_target_from_source.txt");
            text.map_or_else(|| remove(&truth).unwrap(), |text| fs::write(&truth, text).unwrap());
            let (records, lines) = registered(&from, &done);
            assert_eq!(lines, 1, "a truth takes no part in the motion");
            let record = records[0].clone();
            (record.translation_error_m, record.is_untried().then_some(record.stop))
        };
        assert_eq!(error_m(None), (None, None));
        for (text, expected_m) in
            [("1 0 0 9 0 1 0 0 0 0 1 0", 8.7), ("1 0 0 3 0 1 0 0 0 0 1 0", 2.7)]
        {
            let (found_m, untried) = error_m(Some(text));
            assert!((found_m.unwrap() - expected_m).abs() < 0.02, "{found_m:?} {untried:?}");
        }
        let (none, why) = error_m(Some("1 0 0"));
        assert!(none.is_none() && why.unwrap().contains("x_target_from_source.txt"));
        assert_eq!(error_m(None), (None, None), "no error of a truth that is gone");
    }

    /// Registers a table of so many pairs, all alike, on two threads. `told` hears of each record
    /// and may stop. Numbers of the records told, and of the lines kept.
    fn on_two_threads(
        home: &Path,
        count: usize,
        stop: &AtomicBool,
        told: &mut (dyn FnMut(&Record) + Send),
    ) -> [Vec<usize>; 2] {
        if !home.join("a").exists() {
            folder(&home.join("a"), &[("x", 0.3)]);
        }
        let row = "a/x_target.xyz,a/x_source.xyz\n";
        fs::write(home.join("p.csv"), format!("target,source\n{}", row.repeat(count))).unwrap();
        let (pairs, request) = (PairFiles::list(&home.join("p.csv")).unwrap(), request());
        let batch = Batch { pairs: &pairs, truths: &[], request: &request, scales: [1.0; 2] };
        let mut kept = Kept::open(&home.join("done"), "settings").unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let mut heard = 0;
        let mut both = |record: &Record| {
            heard += 1;
            told(record);
        };
        let records = pool.install(|| batch.run(Some(&mut kept), stop, &mut both)).unwrap();
        let text = fs::read_to_string(home.join("done/registered.jsonl")).unwrap();
        let lines = text.lines().skip(1).map(|line| serde_json::from_str(line).unwrap());
        let number = |record: Record| record.name.parse::<usize>().unwrap() - 1;
        let told: Vec<usize> = records.into_iter().map(number).collect();
        assert_eq!(told.len(), heard);
        [told, lines.map(number).collect()]
    }

    #[test]
    fn pairs_are_done_nearly_in_the_order_in_which_they_are_told() {
        let home = TempDir::new().unwrap();
        let never = AtomicBool::new(false);
        let [told, kept] = on_two_threads(home.path(), 40, &never, &mut |_| ());
        assert_eq!(told, (0..40).collect::<Vec<usize>>());
        for done in 1..=kept.len() {
            let last = kept[..done].iter().max().unwrap();
            let waited_for = last + 1 - done;
            assert!(waited_for <= 1, "the other thread works on one pair: {kept:?}");
        }
    }

    #[test]
    fn all_that_is_done_is_told_after_an_interrupt() {
        let home = TempDir::new().unwrap();
        let stop = AtomicBool::new(false);
        let at_first = &mut |_: &Record| stop.store(true, Ordering::Relaxed);
        let [told, mut kept] = on_two_threads(home.path(), 40, &stop, at_first);
        kept.sort();
        assert!(told == kept && told.len() < 40, "{told:?} told, {kept:?} kept");
        let never = AtomicBool::new(false);
        on_two_threads(home.path(), 40, &never, &mut |_| ());
        // Begun again and stopped at once: one is to do, and the others are done.
        fs::remove_file(home.path().join("done/3.ply")).unwrap();
        let [told, _] = on_two_threads(home.path(), 40, &stop, &mut |_| ());
        assert_eq!(told, (0..40).filter(|&number| number != 2).collect::<Vec<usize>>());
    }

    #[test]
    fn a_record_without_its_files_is_done_anew_and_one_with_more_is_read() {
        let home = TempDir::new().unwrap();
        let done = home.path().join("done");
        let from = folder(&home.path().join("a"), &[("x", 0.3)]);
        registered(&from, &done);
        let records = done.join("registered.jsonl");
        let text = fs::read_to_string(&records).unwrap();
        let more = text.replace("\"name\":", "\"later\":[1],\"name\":");
        assert_ne!(more, text);
        fs::write(&records, more).unwrap();
        assert_eq!(registered(&from, &done).1, 1);
        // As such folders were before.
        let inputs = text.find(",\"inputs\"").unwrap();
        fs::write(&records, format!("{}}}\n", &text[..inputs])).unwrap();
        assert_eq!((registered(&from, &done).1, registered(&from, &done).1), (2, 2));
    }
}
