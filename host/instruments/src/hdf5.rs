//! HDF5: the waveforms of GEDI (L1B) and LVIS (L1B), and arrays of one or two dimensions.
//!
//! ```text
//! GEDI   BEAMxxxx/rxwaveform, all shots end to end;  BEAMxxxx/rx_sample_start_index, from 1, and
//!        BEAMxxxx/rx_sample_count: the samples of each shot;  tx… of the emitted pulses
//! LVIS   RXWAVE, a shot a row;  TXWAVE of the emitted pulses
//! ```

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use echoloop_files::{NumberType, one_line};
use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::storage::{BlockCacheStorage, BytesStorage, DynStorage, FileStorage};
use hdf5_reader::{Dataset, Datatype, Hdf5File, OpenOptions};

use super::array::{Array, Layout, Number};
use super::axis::TimeAxis;
use super::rows::Rows;

const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";

/// True when the bytes begin as an HDF5 file.
pub(super) fn is_hdf5(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// True when a file begins as an HDF5 file. What is no regular file cannot be read from its middle.
pub(super) fn is_hdf5_file(path: &Path) -> bool {
    let is_file = path.metadata().is_ok_and(|metadata| metadata.is_file());
    let mut first = [0; MAGIC.len()];
    is_file
        && File::open(path).and_then(|mut file| file.read_exact(&mut first)).is_ok()
        && is_hdf5(&first)
}

/// Waveforms of an HDF5 file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// A dataset, or the group that it is in; the whole file where nothing is given.
    pub name: Option<String>,
    /// Received or emitted: which of two in a group.
    pub kind: Kind,
}

/// The two waveforms of a shot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// What came back.
    #[default]
    Received,
    /// The emitted pulse.
    Emitted,
    /// The emitted pulse, where the name is that of what came back.
    EmittedBeside,
}

impl Kind {
    /// Names of a dataset of GEDI and of LVIS.
    fn names(self) -> [&'static str; 2] {
        match self {
            Self::Received => ["rxwaveform", "RXWAVE"],
            Self::Emitted | Self::EmittedBeside => ["txwaveform", "TXWAVE"],
        }
    }

    /// Flag of `echoes` that names a dataset.
    fn flag(self) -> &'static str {
        match self {
            Self::Received => "--dataset",
            Self::Emitted | Self::EmittedBeside => "--outgoing-dataset",
        }
    }
}

/// Greatest size of the samples read, over that of the file, and what comes on top. Recorded noise
/// is compressed by far less; an array that was never written takes no room at all.
const MOST_OF_FILE: u64 = 64;
const MORE: u64 = 1 << 20;

/// Bytes of a block of the file that is kept, and their number: the names lie in many places.
const BLOCK: usize = 1 << 16;
const BLOCKS: usize = 64;

/// Depth of groups, and number of datasets, that are looked at for waveforms.
const DEPTH: usize = 4;
const LOOKED: usize = 10_000;

/// Datasets that a message lists.
const LISTED: usize = 8;

/// Reads from a regular file, without the parts that are not asked for.
pub(super) fn read(path: &Path, selection: &Selection) -> Result<Rows, String> {
    let file = FileStorage::open(path).map_err(|problem| refused(&problem))?;
    parse_from(Arc::new(BlockCacheStorage::new(Arc::new(file), BLOCK, BLOCKS)), selection)
}

/// Reads from bytes.
pub(super) fn parse(bytes: Vec<u8>, selection: &Selection) -> Result<Rows, String> {
    parse_from(Arc::new(BytesStorage::new(bytes)), selection)
}

fn parse_from(storage: DynStorage, selection: &Selection) -> Result<Rows, String> {
    let most = storage.len().saturating_mul(MOST_OF_FILE).saturating_add(MORE);
    let most = usize::try_from(most).unwrap_or(usize::MAX);
    let options = OpenOptions::default().with_max_read_bytes(most).with_max_chunk_bytes(most);
    let file = Hdf5File::from_storage_with_options(storage, options).map_err(|e| refused(&e))?;
    let (path, group, dataset) = selected(&file, selection)?;
    let rows = rows(&group, &dataset).map_err(|problem| format!("dataset {path}: {problem}"))?;
    match selection.name {
        Some(_) => Ok(rows),
        None => Ok(rows.with_remark(format!("waveforms of dataset {path}"))),
    }
}

fn refused(problem: &Error) -> String {
    format!("not an HDF5 file of waveforms: {}", one_line(&problem.to_string()))
}

/// Path, group and dataset of a selection.
fn selected(file: &Hdf5File, wanted: &Selection) -> Result<(String, Group, Dataset), String> {
    let root = file.root_group().map_err(|e| refused(&e))?;
    let (mut prefix, mut group) = (String::new(), root);
    let mut parts = wanted.name.iter().flat_map(|name| name.split('/')).filter(|p| !p.is_empty());
    while let Some(part) = parts.next() {
        if let Ok(inner) = group.group(part) {
            (prefix, group) = (format!("{prefix}/{part}"), inner);
        } else if let (Ok(dataset), None) = (group.dataset(part), parts.next()) {
            if wanted.kind == Kind::EmittedBeside {
                break;
            }
            return Ok((format!("{prefix}/{part}"), group, dataset));
        } else {
            let (groups, datasets) = group.member_names().map_err(|e| refused(&e))?;
            let names: Vec<String> = groups.into_iter().chain(datasets).collect();
            let (found, within) = (one_line(part), one_line(&prefix));
            return Err(format!("{within}/{found} does not exist; there are {}", listed(&names)));
        }
    }
    let mut all = Vec::new();
    within(&group, &prefix, DEPTH, &mut all).map_err(|e| refused(&e))?;
    let is_named = |(path, ..): &&Found| {
        let name = last_part(path);
        wanted.kind.names().contains(&name)
    };
    let mut fitting: Vec<&Found> = all.iter().filter(is_named).collect();
    if fitting.is_empty() && wanted.kind == Kind::Received {
        fitting = all.iter().filter(|(.., dataset)| dataset.ndim() == 2).collect();
    }
    match fitting[..] {
        [found] => Ok(found.clone()),
        [] => Err(format!(
            "no dataset named {} or {}: {} names one of {}",
            wanted.kind.names()[0],
            wanted.kind.names()[1],
            wanted.kind.flag(),
            listed(&all.iter().map(|(path, ..)| path.clone()).collect::<Vec<_>>())
        )),
        _ => Err(format!(
            "{} datasets of waveforms: {} names one of {}",
            fitting.len(),
            wanted.kind.flag(),
            listed(&fitting.iter().map(|(path, ..)| path.clone()).collect::<Vec<_>>())
        )),
    }
}

/// Name of a dataset or group within its group.
fn last_part(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or_default()
}

/// Path of a dataset, its group, and itself.
type Found = (String, Group, Dataset);

/// All datasets of numbers in a group and the groups in it.
fn within(group: &Group, prefix: &str, depth: usize, all: &mut Vec<Found>) -> Result<(), Error> {
    let (groups, datasets) = group.members()?;
    for dataset in datasets {
        let name = last_part(dataset.name());
        if kind_of(dataset.dtype()).is_some() && all.len() < LOOKED {
            all.push((format!("{prefix}/{name}"), group.clone(), dataset));
        }
    }
    for inner in groups.iter().filter(|_| depth > 1) {
        let name = last_part(inner.name());
        within(inner, &format!("{prefix}/{name}"), depth - 1, all)?;
    }
    Ok(())
}

/// The first names of many.
fn listed(names: &[String]) -> String {
    let first: Vec<String> = names.iter().take(LISTED).map(|name| one_line(name)).collect();
    match names.len().saturating_sub(LISTED) {
        0 if names.is_empty() => "none".into(),
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

/// Type of the numbers; `None` of what is no number.
fn kind_of(dtype: &Datatype) -> Option<NumberType> {
    Some(match *dtype {
        Datatype::FixedPoint { size: 1, signed: false, .. } => NumberType::U8,
        Datatype::FixedPoint { size: 2, signed: false, .. } => NumberType::U16,
        Datatype::FixedPoint { size: 4, signed: false, .. } => NumberType::U32,
        Datatype::FixedPoint { size: 8, signed: false, .. } => NumberType::U64,
        Datatype::FixedPoint { size: 1, .. } => NumberType::I8,
        Datatype::FixedPoint { size: 2, .. } => NumberType::I16,
        Datatype::FixedPoint { size: 4, .. } => NumberType::I32,
        Datatype::FixedPoint { size: 8, .. } => NumberType::I64,
        Datatype::FloatingPoint { size: 4, .. } => NumberType::F32,
        Datatype::FloatingPoint { size: 8, .. } => NumberType::F64,
        _ => return None,
    })
}

fn rows(group: &Group, dataset: &Dataset) -> Result<Rows, String> {
    let kind = kind_of(dataset.dtype()).ok_or("expected numbers of 1 to 8 bytes")?;
    let shape = dataset.shape();
    let (rows, columns) = match *shape {
        [columns] => (1, columns),
        [rows, columns] => (rows, columns),
        _ => return Err(format!("expected one or two dimensions, found {}", shape.len())),
    };
    let size = |n: u64| usize::try_from(n).map_err(|_| format!("expected fewer than {n} numbers"));
    let (rows, columns) = (size(rows)?, size(columns)?);
    if columns == 0 && rows > 0 {
        // Rows without a number take no room in the file: nothing bounds how many it claims.
        return Err(format!("expected a number or more a row, found {rows} × 0 numbers"));
    }
    let pieces = match shape.len() {
        1 => pieces(group, dataset.name(), columns)?,
        _ => None,
    };
    let is_gedi = pieces.is_some();
    let layout = match pieces {
        Some(pieces) => Layout::Pieces(pieces),
        None => Layout::Table { rows, columns, by_columns: false },
    };
    let bytes = dataset.read_native_bytes().map_err(|e| one_line(&e.to_string()))?;
    let fill = dataset.attribute("_FillValue").ok().and_then(|fill| fill.read_as_f64().ok());
    // As the samples are stored: -9999.9 is another number in four bytes.
    let fill = fill.map(|fill| if kind == NumberType::F32 { f64::from(fill as f32) } else { fill });
    let array = Array::new(bytes, Number::native(kind), layout, fill)?;
    let rows = Rows::of_array(array).with_fill(fill);
    Ok(if is_gedi { rows.with_axis(NANOSECOND) } else { rows })
}

/// Time between GEDI's samples.
const NANOSECOND: TimeAxis = TimeAxis { step: 1e-9, is_in_seconds: true };

/// Samples of each shot, of GEDI's datasets; `None` of any other.
fn pieces(group: &Group, name: &str, samples: usize) -> Result<Option<Vec<Range<usize>>>, String> {
    let name = last_part(name);
    let Some(prefix) = name.strip_suffix("waveform") else { return Ok(None) };
    let read = |part: &str| {
        let name = format!("{prefix}_sample_{part}");
        let dataset = group.dataset(&name).ok()?;
        let kind = kind_of(dataset.dtype())?;
        let bytes = dataset.read_native_bytes().map_err(|e| one_line(&e.to_string()));
        Some(bytes.map(|bytes| {
            let number = Number::native(kind);
            bytes.chunks_exact(kind.size()).map(|bytes| number.read(bytes)).collect::<Vec<f64>>()
        }))
    };
    let (Some(starts), Some(counts)) = (read("start_index"), read("count")) else {
        return Ok(None);
    };
    let (starts, counts) = (starts?, counts?);
    if starts.len() != counts.len() {
        return Err(format!(
            "expected as many {prefix}_sample_start_index as {prefix}_sample_count, found {} and \
             {}",
            starts.len(),
            counts.len()
        ));
    }
    let mut left = samples;
    let mut pieces = Vec::with_capacity(starts.len());
    for (shot, (start, count)) in starts.into_iter().zip(counts).enumerate() {
        let is_within = start >= 1.0 && count >= 0.0 && start - 1.0 + count <= samples as f64;
        // Shots that share samples could be many times as long as the file.
        if !is_within || count > left as f64 {
            return Err(format!(
                "shot {shot} (from 0): expected samples of its own within the {samples} of \
                 {name}, found {count} from the {start}th on"
            ));
        }
        left -= count as usize;
        let start = start as usize - 1;
        pieces.push(start..start + count as usize);
    }
    Ok(Some(pieces))
}
