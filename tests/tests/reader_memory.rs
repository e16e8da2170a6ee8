//! Memory of the file readers: at most 8 times the file and 64 MB, whatever the file.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use echoloop_closed_loop::config;
use echoloop_closed_loop::run_folder::journal::whole_generations;
use echoloop_clouds::parse_recorded;
use echoloop_clouds::pose::parse_pose;
use echoloop_instruments::{Selection, parse_waveforms};
use echoloop_sim::import::{Ground, ImportOptions, parse_scene};

/// The system's allocator, with the allocated bytes counted.
struct Counted;

static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

fn grown(by: usize) {
    let now = NOW.fetch_add(by, Ordering::Relaxed) + by;
    MOST.fetch_max(now, Ordering::Relaxed);
}

// SAFETY: everything is handed to the system's allocator as it came.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }

    /// A large block moves by its pages, so old and new do not exist at the same time.
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        grown(size);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// Peak of allocated bytes while a file is read, including the file's, and whether it was read.
fn most(file: Vec<u8>, read: impl FnOnce(Vec<u8>) -> bool) -> (usize, bool) {
    let before = NOW.load(Ordering::Relaxed) - file.len();
    MOST.store(NOW.load(Ordering::Relaxed), Ordering::Relaxed);
    let is_read = read(file);
    (MOST.load(Ordering::Relaxed) - before, is_read)
}

fn scene(name: &str, file: Vec<u8>) -> bool {
    let options = ImportOptions { ground: Ground::None, ..ImportOptions::default() };
    parse_scene(Path::new(name), &file, &options).is_ok()
}

fn cloud(name: &str, file: Vec<u8>) -> bool {
    parse_recorded(Path::new(name), &file).is_ok()
}

fn waveforms(_: &str, file: Vec<u8>) -> bool {
    let rows = parse_waveforms(Path::new("any"), file, &Selection::default()).unwrap();
    (0..rows.len()).step_by(1000).all(|i| rows.row(i).iter().all(|v| v.is_finite()))
}

/// A text file cut to the longest accepted.
fn short(mut file: Vec<u8>) -> String {
    file.truncate(echoloop_files::MOST_TEXT as usize);
    String::from_utf8(file).unwrap()
}

fn pose(name: &str, file: Vec<u8>) -> bool {
    parse_pose(Path::new(name), &short(file)).is_ok()
}

fn journal(_: &str, file: Vec<u8>) -> bool {
    whole_generations(&file).is_ok()
}

fn configuration(_: &str, file: Vec<u8>) -> bool {
    config::parse(&short(file)).is_ok()
}

/// Size of each file, bytes: large beside the allowance of 64 MB.
const SIZE: usize = 32 << 20;

fn repeated(head: &str, piece: &[u8], tail: &[u8]) -> Vec<u8> {
    [head.as_bytes(), &piece.repeat((SIZE - head.len()) / piece.len()), tail].concat()
}

fn ply(format: &str, more: &str, count: usize, body: &[u8]) -> Vec<u8> {
    let head = format!(
        "ply\nformat {format} 1.0\n{more}element vertex {count}\nproperty uchar x\n\
         property uchar y\nproperty uchar z\nelement face 0\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    repeated(&head, body, &[])
}

fn npy(descr: &str, rows: usize, columns: usize, size: usize) -> Vec<u8> {
    let header =
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    let length = (header.len() as u16).to_le_bytes();
    let head = [b"\x93NUMPY\x01\0", &length[..], header.as_bytes()].concat();
    [head, vec![1; rows * columns * size]].concat()
}

/// Compressed points of three numbers each, all bytes the same, with the best possible compression.
fn packed_pcd(points: u32, (size, kind, byte): (u32, char, u8)) -> Vec<u8> {
    let unpacked = 3 * size * points;
    let (copies, left) = ((unpacked - 1) / 264, (unpacked - 1) % 264);
    let same = [0, byte];
    let packed =
        [&same[..], &[0xe0, 255, 0].repeat(copies as usize), &same.repeat(left as usize)].concat();
    let head = format!(
        "VERSION 0.7\nFIELDS x y z\nSIZE {size} {size} {size}\nTYPE {kind} {kind} {kind}\n\
         COUNT 1 1 1\nWIDTH {points}\nHEIGHT 1\nPOINTS {points}\nDATA binary_compressed\n"
    );
    let sizes = [packed.len() as u32, unpacked].map(u32::to_le_bytes).concat();
    [head.into_bytes(), sizes, packed].concat()
}

/// PCD of points of eleven numbers each, as short as possible in the file; numbers of text are long
/// in memory.
fn wide_pcd(data: &str, record: &[u8]) -> Vec<u8> {
    let (size, kind) = if data == "ascii" { ("8", "F") } else { ("1", "U") };
    let row = |word: &str| format!(" {word}").repeat(11);
    let points = SIZE / record.len() - 100;
    let head = format!(
        "VERSION 0.7\nFIELDS x y z a b c d e f g h\nSIZE{}\nTYPE{}\nWIDTH {points}\nHEIGHT 1\n\
         POINTS {points}\nDATA {data}\n",
        row(size),
        row(kind)
    );
    repeated(&head, record, &[])
}

/// PLY as [`wide_pcd`].
fn wide_ply(format: &str, kind: &str, record: &[u8]) -> Vec<u8> {
    let names = ["x", "y", "z", "a", "b", "c", "d", "e", "f", "g", "h"];
    let properties = names.map(|name| format!("property {kind} {name}\n")).concat();
    let points = SIZE / record.len() - 100;
    let head =
        format!("ply\nformat {format} 1.0\nelement vertex {points}\n{properties}end_header\n");
    repeated(&head, record, &[])
}

/// A mesh of polygons with a number of corners, a byte each.
fn polygons(corners: u32) -> Vec<u8> {
    let faces = SIZE / (corners as usize + 4);
    let head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty uchar x\n\
         property uchar y\nproperty uchar z\nelement face {faces}\n\
         property list uint uchar vertex_indices\nend_header\n"
    );
    let face = [&corners.to_le_bytes()[..], &[0, 1, 2].repeat(corners as usize / 3)].concat();
    [head.as_bytes(), &[0, 0, 0, 9, 0, 0, 0, 9, 0], &face.repeat(faces)].concat()
}

/// A glTF document with many things of one kind.
fn gltf(kind: &str, thing: &[u8], count: usize) -> Vec<u8> {
    let head = format!(r#"{{"asset":{{"version":"2.0"}},"{kind}":["#);
    [head.as_bytes(), &thing.repeat(count), b"{}]}"].concat()
}

/// A glTF document whose nodes show the same million corners ten times, which is too many.
fn shown_again() -> Vec<u8> {
    let count = 1_000_000;
    let (length, nodes) = (12 * count, r#"{"mesh":0},"#.repeat(9));
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{nodes}{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "buffers":[{{"byteLength":{length}}}],"bufferViews":[{{"buffer":0,"byteLength":{length}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3",
        "min":[0,0,0],"max":[0,0,0]}}]}}"#
    );
    let chunk =
        |kind: &[u8; 4], body: &[u8]| [&(body.len() as u32).to_le_bytes()[..], kind, body].concat();
    let chunks = [chunk(b"JSON", json.as_bytes()), chunk(b"BIN\0", &vec![0; 12 * count])].concat();
    let length = (12 + chunks.len() as u32).to_le_bytes();
    [b"glTF", &2_u32.to_le_bytes()[..], &length, &chunks].concat()
}

const STL_FACET: &[u8] = b"vertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\n";

type Reader = fn(&str, Vec<u8>) -> bool;

/// Maker of a file, called when needed: all files together would take a GB.
type File<'a> = Box<dyn Fn() -> Vec<u8> + 'a>;

#[test]
fn no_reader_takes_more_than_eight_times_its_file_and_64_mb() {
    let hollow = format!("element hollow {}\nproperty uchar a\n", SIZE - 1000);
    let lists = format!("element hollow {}\nproperty list uchar uchar a\n", SIZE / 4);
    let list = "element hollow 1\nproperty list uint uchar a\n";
    let ascii = "ply\nformat ascii 1.0\ncomment ";
    let header =
        "VERSION 0.7\nFIELDS x y z\nSIZE 1 1 1\nTYPE U U U\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 1\n";
    let points = SIZE / 3 - 100;
    let table: Vec<(&str, Reader, File<'_>)> = vec![
        ("rows of a byte", waveforms, Box::new(|| npy("|u1", SIZE, 1, 1))),
        ("one row of bytes", waveforms, Box::new(|| npy("|i1", 1, SIZE, 1))),
        ("rows of eight bytes", waveforms, Box::new(|| npy("<f8", SIZE / 80, 10, 8))),
        ("short lines", waveforms, Box::new(|| repeated("1\n", b"1\n", &[]))),
        ("empty lines", waveforms, Box::new(|| repeated("1\n", b"\n", b"1\n"))),
        ("one long line", waveforms, Box::new(|| repeated("1", b",1", &[]))),
        ("a.ply", cloud, Box::new(|| ply("binary_little_endian", "", points, &[1, 2, 3]))),
        ("a.ply", cloud, Box::new(|| ply("ascii", "", SIZE / 6 - 100, b"1 2 3\n"))),
        ("a.ply", cloud, Box::new(|| ply("binary_little_endian", &hollow, 0, &[1]))),
        ("a.ply", cloud, Box::new(|| ply("binary_little_endian", &lists, 0, &[3, 1, 1, 1]))),
        ("a.ply", cloud, Box::new(|| ply("binary_little_endian", list, 0, &[0, 0, 0, 1]))),
        ("a.ply", cloud, Box::new(|| ply("ascii", list, 0, b"1 "))),
        ("a.ply", cloud, Box::new(|| repeated(ascii, b"\ncomment", &[]))),
        ("a.ply", cloud, Box::new(|| repeated("ply\nformat ascii 1.0\n", b"element a 0\n", &[]))),
        ("a.ply", scene, Box::new(|| ply("binary_little_endian", &hollow, 0, &[1]))),
        ("a.ply", scene, Box::new(|| ply("binary_big_endian", &lists, 0, &[3, 1, 1, 1]))),
        ("a.ply", scene, Box::new(|| polygons(300))),
        ("a.ply", scene, Box::new(|| polygons(30_000_000))),
        ("a.obj", scene, Box::new(|| repeated("", b"\\\n", b"\n"))),
        ("a.obj", scene, Box::new(|| repeated("", b"v 1 1 1\n", b"f 1 2 3\n"))),
        ("a.obj", scene, Box::new(|| repeated("v 1 1 1\nf 1 1 1", b" 1", &[]))),
        ("a.obj", scene, Box::new(|| repeated("v 1 1 1\n", b"f 1 1 1\n", &[]))),
        ("a.obj", scene, Box::new(|| repeated("v 1 1 1\nf 1 1 1\n", b"usemtl a\n", &[]))),
        ("a.gltf", scene, Box::new(|| gltf("materials", b"{},", 131_000))),
        ("a.gltf", scene, Box::new(|| gltf("nodes", b"{},", 131_000))),
        ("a.gltf", scene, Box::new(|| gltf("accessors", b"{},", 131_000))),
        ("a.gltf", scene, Box::new(|| gltf("nodes", b"{\"children\":[9,9,9,9,9,9,9]},", 60_000))),
        ("a.gltf", scene, Box::new(shown_again)),
        ("a.stl", scene, Box::new(|| repeated("solid\n", STL_FACET, b"endsolid\n"))),
        ("a.stl", scene, Box::new(|| repeated("solid", b" a", &[]))),
        ("a.pcd", cloud, Box::new(|| packed_pcd(20_000_000, (1, 'U', 7)))),
        ("a.pcd", cloud, Box::new(|| packed_pcd(4_000_000, (1, 'U', 7)))),
        // 3,156 m from the origin, where f64 are kept beside the points: too many, and few enough.
        ("a.pcd", cloud, Box::new(|| packed_pcd(4_000_000, (4, 'F', 0x45)))),
        ("a.pcd", cloud, Box::new(|| packed_pcd(1_400_000, (4, 'F', 0x45)))),
        (
            "a.pcd",
            cloud,
            Box::new(|| repeated(&format!("{header}POINTS {points}\nDATA binary\n"), &[1], &[])),
        ),
        (
            "a.pcd",
            cloud,
            Box::new(|| repeated(&format!("{header}POINTS 1\nDATA ascii\n"), b"1 ", &[])),
        ),
        ("a.pcd", cloud, Box::new(|| repeated("VERSION", b" 1", &[]))),
        ("a.pcd", cloud, Box::new(|| wide_pcd("binary", &[1; 11]))),
        ("a.pcd", cloud, Box::new(|| wide_pcd("ascii", b"1 1 1 1 1 1 1 1 1 1 1\n"))),
        ("a.ply", cloud, Box::new(|| wide_ply("binary_little_endian", "uchar", &[1; 11]))),
        ("a.ply", cloud, Box::new(|| wide_ply("ascii", "double", b"1 1 1 1 1 1 1 1 1 1 1\n"))),
        ("a.bin", cloud, Box::new(|| repeated("", &[0, 0, 128, 63], &[]))),
        ("a.xyz", cloud, Box::new(|| repeated("", b"1 1 1\n", &[]))),
        ("a.xyz", cloud, Box::new(|| repeated("", b"2e3 1 1\n", &[]))),
        ("a.xyz", cloud, Box::new(|| repeated("x,y,z", b",1", &[]))),
        ("a.ply", cloud, Box::new(|| wide_ply("binary_little_endian", "short", &[9; 22]))),
        (
            "a.vtk",
            cloud,
            Box::new(|| {
                repeated(
                    "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n\
                     POINTS 5000000 float\n",
                    b"1 ",
                    &[],
                )
            }),
        ),
        ("history.jsonl", journal, Box::new(|| repeated("{\"journal\":[0", b",0", b"]}\n"))),
        ("a.txt", pose, Box::new(|| repeated("1", b" 1", &[]))),
        (
            "a.json",
            pose,
            Box::new(|| [b"[0".to_vec(), b",0".repeat(1 << 19), b"]".to_vec()].concat()),
        ),
        ("a.toml", configuration, Box::new(|| b"a.b=[]\n".repeat(1 << 17))),
        (
            "a.toml",
            configuration,
            Box::new(|| [b"a=[0".to_vec(), b",0".repeat(1 << 19), b"]".to_vec()].concat()),
        ),
    ];
    let (mut broken, mut taken) = (Vec::new(), 0);
    for (index, (name, read, file)) in table.into_iter().enumerate() {
        let file = file();
        let size = file.len();
        let (found, is_read) = most(file, |file| read(name, file));
        taken += u32::from(is_read);
        if found > 8 * size + (64 << 20) {
            broken.push(format!("{index} {name}: {found} bytes for {size}"));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert_eq!(taken, 21, "number of valid files");
}
