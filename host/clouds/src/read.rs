//! Reading a cloud: the extension of the file tells the format.

use std::path::Path;

use echoloop_files::{FileError, read_data};

use crate::error::CloudError;
use crate::format::{Format, READ, read_extensions};
use crate::recorded::{Keep, Recorded};
use crate::{Cloud, Dropped};

/// Reads the points of a file, in metres, and their σ_R.
///
/// PLY and PCD may have a `range_sd`, which becomes [`Cloud::range_sd_m`]. Everything else is
/// ignored, the viewpoint of a PCD too; [`read_recorded`] keeps the columns. Points that are no
/// echo are left out and counted.
///
/// # Errors
///
/// [`CloudError`] names the file and what was expected of it. A file without an echo is an error,
/// and so are survey coordinates that `f32` does not hold: [`read_points`] takes a shift out of
/// them.
pub fn read_cloud(path: &Path) -> Result<(Cloud, Dropped), CloudError> {
    near(path, read(path, Keep::Points)?)
}

/// [`read_cloud`] of any coordinates up to [`MOST_COORDINATE_M`](crate::survey::MOST_COORDINATE_M):
/// far from the origin the cloud gets a [shift](Recorded::shift_m).
pub fn read_points(path: &Path) -> Result<(Recorded, Dropped), CloudError> {
    read(path, Keep::Points).map(located)
}

/// [`read_points`] with everything that a PLY or a PCD says of each point, and KITTI's intensity.
pub fn read_recorded(path: &Path) -> Result<(Recorded, Dropped), CloudError> {
    read(path, Keep::All).map(located)
}

/// [`read_cloud`] of bytes in memory; the extension of `path` tells the format.
pub fn parse_cloud(path: &Path, bytes: &[u8]) -> Result<(Cloud, Dropped), CloudError> {
    let format = format_of(path)?;
    near(path, checked(path, (format.read)(bytes, Keep::Points), bytes.len())?)
}

/// [`read_recorded`] of bytes in memory; the extension of `path` tells the format.
pub fn parse_recorded(path: &Path, bytes: &[u8]) -> Result<(Recorded, Dropped), CloudError> {
    let format = format_of(path)?;
    checked(path, (format.read)(bytes, Keep::All), bytes.len()).map(located)
}

fn read(path: &Path, keep: Keep) -> Result<(Recorded, Dropped), CloudError> {
    // Before the file is opened: a wrong extension is refused whatever the file holds.
    let format = format_of(path)?;
    let bytes = read_data(path).map_err(FileError::io(path))?;
    checked(path, (format.read)(&bytes, keep), bytes.len())
}

fn near(
    path: &Path,
    (recorded, dropped): (Recorded, Dropped),
) -> Result<(Cloud, Dropped), CloudError> {
    Ok((recorded.into_cloud().map_err(FileError::content(path))?, dropped))
}

fn located((mut recorded, dropped): (Recorded, Dropped)) -> (Recorded, Dropped) {
    recorded.locate();
    (recorded, dropped)
}

/// True when a file is of a format that is read, by its extension.
pub fn is_readable(path: &Path) -> bool {
    by_extension(path).is_some()
}

fn by_extension(path: &Path) -> Option<&'static Format> {
    let extension = path.extension().unwrap_or_default();
    let has =
        |format: &&Format| format.extensions.iter().any(|e| extension.eq_ignore_ascii_case(e));
    READ.iter().find(has)
}

fn format_of(path: &Path) -> Result<&'static Format, FileError> {
    let expected = || format!("expected a {} file", read_extensions());
    by_extension(path).ok_or_else(expected).map_err(FileError::content(path))
}

/// Leaves out points that are no echo. Refuses a cloud with a bad σ_R, with coordinates that are
/// too large, without an echo, or of too many points for its size.
fn checked(
    path: &Path,
    read: Result<Recorded, String>,
    size: usize,
) -> Result<(Recorded, Dropped), CloudError> {
    let mut recorded = read.map_err(FileError::content(path))?;
    recorded.check_range().and_then(|()| recorded.check_sds()).map_err(FileError::content(path))?;
    let dropped = recorded.drop_invalid();
    if recorded.cloud.points.is_empty() {
        return Err(CloudError::Empty { path: path.into(), dropped });
    }
    recorded.check_growth(size as u64).map_err(FileError::content(path))?;
    Ok((recorded, dropped))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use echoloop_files::Column;
    use echoloop_files::attribute::{ATTRIBUTES, Attribute, RING};
    use nalgebra::{Point3, Vector3};

    use crate::{CloudFormat, write_cloud};

    fn read(name: &str, content: &[u8]) -> Result<(Cloud, Dropped), CloudError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        read_cloud(&path)
    }

    fn bytes(header: &str, body: &[u8]) -> Vec<u8> {
        [header.as_bytes(), body].concat()
    }

    fn le(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    const PCD: &str = "VERSION 0.7\nFIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n\
                       WIDTH 2\nHEIGHT 1\n";

    const VTK: &str = "# vtk DataFile Version 3.0\nt\n";

    #[test]
    fn the_same_two_points_come_from_each_format() {
        let ply = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\ncomment c\nelement vertex 2\nproperty ushort i\n\
                 property double z\n\
                 property float x\nproperty short y\nend_header\n"
            )
        };
        let big = [&[0, 7][..], &3f64.to_be_bytes(), &1f32.to_be_bytes(), &2i16.to_be_bytes()];
        let big = [
            big.concat(),
            [&[0, 7][..], &6f64.to_be_bytes(), &4f32.to_be_bytes(), &5i16.to_be_bytes()].concat(),
        ];
        let little = [&[7, 0][..], &3f64.to_le_bytes(), &1f32.to_le_bytes(), &2i16.to_le_bytes()];
        let little = [
            little.concat(),
            [&[7, 0][..], &6f64.to_le_bytes(), &4f32.to_le_bytes(), &5i16.to_le_bytes()].concat(),
        ];
        let pcd = le(&[1.0, 2.0, 3.0, 0.5, 4.0, 5.0, 6.0, 0.5]);
        // One literal run of 32 bytes: column by column.
        let columns = le(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0, 0.5, 0.5]);
        let packed = [&33u32.to_le_bytes()[..], &32u32.to_le_bytes(), &[31], &columns].concat();
        let table = [
            ("a.ply", bytes(&ply("ascii"), b"7 3 1 2\n7 6 4 5\n")),
            ("b.PLY", bytes(&ply("binary_big_endian"), &big.concat())),
            ("c.ply", bytes(&ply("binary_little_endian"), &little.concat())),
            ("a.pcd", bytes(PCD, b"POINTS 2\nDATA ascii\n1 2 3 0.5\n4 5 6 0.5\n")),
            ("b.pcd", bytes(&format!("{PCD}POINTS 2\nDATA binary\n"), &pcd)),
            ("c.pcd", bytes(&format!("{PCD}POINTS 2\nDATA binary_compressed\n"), &packed)),
            ("a.bin", pcd.clone()),
            (
                "a.vtk",
                b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n\
                  1 2 3 4 5 6\n"
                    .to_vec(),
            ),
            ("a.xyz", b"# x y z\n1 2 3 9\n\n4\t5 6\n".to_vec()),
            ("a.csv", b"time,X,Y,Z\n0,1,2,3\n1,4,5,6\n".to_vec()),
            ("b.csv", b"1,2,3\n4;5;6\n".to_vec()),
        ];
        for (name, content) in table {
            let (cloud, dropped) = read(name, &content).unwrap();
            assert_eq!(cloud.points, [[1.0, 2.0, 3.0].into(), [4.0, 5.0, 6.0].into()], "{name}");
            assert_eq!(dropped, Dropped::default(), "{name}");
        }
    }

    #[test]
    fn a_malformed_file_is_an_error_that_names_the_file_and_what_was_expected() {
        let vertex = "ply\nformat binary_little_endian 1.0\nelement vertex ";
        let xyz = "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        let list = "\nproperty list uint uchar x\nproperty float y\nproperty float z\nend_header\n";
        let huge = u64::MAX.to_string();
        let table: Vec<(&str, Vec<u8>, &str)> = vec![
            ("a.las", vec![], "expected a .ply"),
            ("none", vec![], "expected a .ply"),
            ("empty.ply", vec![], "PLY"),
            ("magic.ply", b"plx\n".to_vec(), "ply"),
            ("utf8.ply", vec![0xff; 100], "PLY"),
            (
                "faces.ply",
                b"ply\nformat ascii 1.0\nelement face 0\nend_header\n".to_vec(),
                "vertex",
            ),
            (
                "noz.ply",
                format!("{vertex}1\nproperty float x\nend_header\n1234").into_bytes(),
                "\"y\"",
            ),
            ("short.ply", bytes(&format!("{vertex}2{xyz}"), &[0; 12]), "promises"),
            ("huge.ply", bytes(&format!("{vertex}{huge}{xyz}"), &[0; 12]), "promises"),
            ("giant.ply", bytes(&format!("{vertex}4000000000{xyz}"), &[0; 12]), "promises"),
            ("void.ply", bytes(&format!("{vertex}{huge}\nend_header\n"), &[]), "\"x\""),
            (
                "hollow.ply",
                bytes(
                    &format!("ply\nformat ascii 1.0\nelement hollow {huge}\nelement vertex 1{xyz}"),
                    b"1 1 1\n",
                ),
                "propert",
            ),
            ("list.ply", bytes(&format!("{vertex}1{list}"), &[0xff; 12]), "\"x\""),
            (
                "word.ply",
                format!("ply\nformat ascii 1.0\nelement vertex 1{xyz}1 two 3\n").into_bytes(),
                "ine 8",
            ),
            ("novertex.ply", format!("{vertex}0{xyz}").into_bytes(), "at least one point"),
            (
                "sd.ply",
                format!(
                    "ply\nformat ascii 1.0\nelement vertex 2\nproperty float range_sd{}\
                     0.1 1 2 3\n-1 4 5 6\n",
                    &xyz
                )
                .into_bytes(),
                "the range_sd of point 1, counted from 0, is -1",
            ),
            ("empty.pcd", vec![], "PCD"),
            ("noz.pcd", PCD.replace(" z", " w").into_bytes(), "PCD"),
            (
                "field.pcd",
                bytes(&PCD.replace(" z", " w"), b"POINTS 1\nDATA ascii\n1 2 3 4\n"),
                "\"z\"",
            ),
            ("short.pcd", bytes(&format!("{PCD}POINTS 2\nDATA binary\n"), &[0; 16]), "2 points"),
            ("shorttext.pcd", bytes(PCD, b"POINTS 2\nDATA ascii\n1 2 3 4\n"), "PCD"),
            ("huge.pcd", bytes(&format!("{PCD}POINTS {huge}\nDATA binary\n"), &[0; 16]), "points"),
            (
                "count.pcd",
                bytes(
                    &PCD.replace("COUNT 1 1 1 1", &format!("COUNT {huge} {huge} 1 1")),
                    b"POINTS 1\nDATA ascii\n1\n",
                ),
                "points",
            ),
            (
                "two.pcd",
                bytes(&PCD.replace("COUNT 1 1", "COUNT 2 1"), b"POINTS 1\nDATA ascii\n1 1 2 3 4\n"),
                "one number",
            ),
            (
                "packed.pcd",
                bytes(&format!("{PCD}POINTS 2\nDATA binary_compressed\n"), &[0xff; 8]),
                "compressed",
            ),
            (
                "unpacked.pcd",
                bytes(
                    &format!("{PCD}POINTS 2\nDATA binary_compressed\n"),
                    &[2, 0, 0, 0, 1, 0, 0, 0, 0, 9],
                ),
                "compressed",
            ),
            (
                "nosize.pcd",
                bytes(&format!("{PCD}POINTS 2\nDATA binary_compressed\n"), &[1]),
                "compressed",
            ),
            ("short.vtk", b"# vtk DataFile Version 3.0\n".to_vec(), "VTK"),
            ("odd.bin", vec![0; 17], "multiple of 16"),
            ("empty.bin", vec![], "at least one point"),
            ("zeros.bin", vec![0; 32], "2 at range 0"),
            ("nan.bin", le(&[f32::NAN; 4]), "1 non-finite"),
            ("two.xyz", b"1 2 3\n4 5\n".to_vec(), "line 2"),
            ("word.txt", b"1 2 3\n4 five 6\n".to_vec(), "line 2"),
            ("header.csv", b"a,b,c\n1,2,3\n".to_vec(), "line 1"),
            ("binary.xyz", vec![0xff; 40], "text"),
            ("comments.txt", b"# nothing\n".to_vec(), "at least one point"),
        ];
        for (name, content, expected) in table {
            let message = read(name, &content).expect_err(name).to_string();
            assert!(message.contains(name) && message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_file_cut_short_or_with_a_byte_changed_never_panics() {
        let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n\
                   property list uchar int l\n\
                   property float y\nproperty float z\nend_header\n";
        let body =
            [&le(&[1.0])[..], &[1, 9, 0, 0, 0], &le(&[2.0, 3.0, 4.0]), &[0], &le(&[5.0, 6.0])]
                .concat();
        let columns = le(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0, 0.5, 0.5]);
        let packed = [&33u32.to_le_bytes()[..], &32u32.to_le_bytes(), &[31], &columns].concat();
        let double = format!("{VTK}BINARY\nDATASET POLYDATA\nPOINTS 1 double\n");
        let files = [
            ("f.ply", bytes(ply, &body)),
            ("f.pcd", bytes(&format!("{PCD}POINTS 2\nDATA binary_compressed\n"), &packed)),
            ("g.pcd", bytes(PCD, b"POINTS 2\nDATA ascii\n1 2 3 0.5\n4 5 6 0.5\n")),
            ("f.vtk", bytes(VTK, b"ASCII\nDATASET POLYDATA\nPOINTS 1 float\n1 2 3\n")),
            ("g.vtk", bytes(&double, 1f64.to_be_bytes().repeat(3).as_slice())),
        ];
        for (name, content) in files {
            assert!(read(name, &content).is_ok(), "{name}");
            for at in 0..content.len() {
                let _ = read(name, &content[..at]);
                for flip in [1, 0x10, 0x80, 0xff] {
                    let mut changed = content.clone();
                    changed[at] ^= flip;
                    let _ = read(name, &changed);
                }
            }
        }
    }

    #[test]
    fn an_absent_file_is_an_error_that_names_it() {
        assert!(
            read_cloud(Path::new("absent.ply")).unwrap_err().to_string().contains("absent.ply")
        );
    }

    #[test]
    fn a_written_cloud_reads_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["cloud.ply", "cloud.PCD"] {
            let path = folder.path().join(name);
            let mut cloud = Cloud::new(vec![[0.1, -2.0, 300.0].into(), [1.0, 0.0, -0.0].into()]);
            write_cloud(&path, &cloud).unwrap();
            assert_eq!(read_cloud(&path).unwrap(), (cloud.clone(), Dropped::default()));
            cloud.range_sd_m = Some(vec![0.02, 0.0]);
            write_cloud(&path, &cloud).unwrap();
            assert_eq!(read_cloud(&path).unwrap().0, cloud);
            cloud.normals = Some(vec![[0.0, 0.0, 1.0].into(); 2]);
            write_cloud(&path, &cloud).unwrap();
            assert_eq!(read_cloud(&path).unwrap().0, Cloud { normals: None, ..cloud });
        }
        let refusal = write_cloud(&folder.path().join("cloud.las"), &Cloud::default()).unwrap_err();
        assert!(refusal.to_string().contains(&CloudFormat::extensions()), "{refusal}");
    }

    #[test]
    fn survey_coordinates_come_from_each_format_and_go_as_they_came() {
        let at: [f64; 3] = [694_386.123_456_7, 5_155_487.765_432_1, 381.012_345_6];
        let body: Vec<u8> = at.iter().flat_map(|v| v.to_le_bytes()).collect();
        let big: Vec<u8> = at.iter().flat_map(|v| v.to_be_bytes()).collect();
        let text = format!("{} {} {}\n", at[0], at[1], at[2]);
        let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty double x\n\
                   property double y\nproperty double z\nend_header\n";
        let pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\n\
                   HEIGHT 1\nPOINTS 1\nDATA ";
        let vtk = format!("{VTK}BINARY\nDATASET POLYDATA\nPOINTS 1 double\n");
        let table = [
            ("a.ply", bytes(ply, &body)),
            ("a.pcd", bytes(&format!("{pcd}binary\n"), &body)),
            ("b.pcd", bytes(&format!("{pcd}ascii\n"), text.as_bytes())),
            ("a.vtk", bytes(&vtk, &big)),
            ("a.xyz", text.into_bytes()),
        ];
        for (name, content) in table {
            let (found, _) = parse_recorded(Path::new(name), &content).unwrap();
            assert_eq!(found.shift_m, Vector3::new(694_386.0, 5_155_488.0, 383.0), "{name}");
            let near = found.cloud.points[0].cast::<f64>() + found.shift_m;
            assert!((near - Point3::from(at)).norm() < 1e-6, "{name}");
            for format in CloudFormat::ALL {
                let path = Path::new("again").with_extension(format.name());
                let (again, _) = parse_recorded(&path, &format.recorded(&found)).unwrap();
                assert_eq!(again.exact.unwrap().at_m, [Point3::from(at)], "{name} {format:?}");
            }
            let refusal = parse_cloud(Path::new(name), &content).unwrap_err().to_string();
            assert!(refusal.contains(name) && refusal.contains("survey coordinates"), "{refusal}");
        }
    }

    #[test]
    fn doubles_near_the_origin_have_no_shift_and_are_written_as_doubles() {
        let at: [f64; 3] = [0.1, -2.0, 300.0];
        let body: Vec<u8> = at.iter().flat_map(|v| v.to_le_bytes()).collect();
        let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty double x\n\
                   property double y\nproperty double z\nend_header\n";
        let file = bytes(ply, &body);
        let (found, _) = parse_recorded(Path::new("a.ply"), &file).unwrap();
        assert_eq!(found.shift_m, Vector3::zeros());
        assert_eq!(CloudFormat::Ply.recorded(&found), file);
        assert_eq!(found.cloud, parse_cloud(Path::new("a.ply"), &file).unwrap().0);
        let (text, _) = parse_recorded(Path::new("a.xyz"), b"0.1 -2 300\n").unwrap();
        assert_eq!((&text.cloud, &text.exact), (&found.cloud, &None), "text has no type");
    }

    /// Two points with every attribute, each number another.
    fn with_every_attribute() -> Recorded {
        let points = vec![[0.1, -2.0, 300.0].into(), [1.0, 0.0, -0.0].into()];
        let others = ATTRIBUTES.iter().filter(|attribute| attribute.name != "range_sd");
        let column = |(i, attribute): (usize, &Attribute)| {
            let i = i as f64;
            attribute.column([200.0 + i, 7.0 * i].into_iter())
        };
        Recorded {
            cloud: Cloud { range_sd_m: Some(vec![0.02, 0.0]), ..Cloud::new(points) },
            columns: others.enumerate().map(column).collect(),
            ..Recorded::default()
        }
    }

    #[test]
    fn every_attribute_reads_back_from_every_format_of_columns_with_its_kind() {
        let written = with_every_attribute();
        assert_eq!(written.columns.len(), 9);
        for format in CloudFormat::ALL.into_iter().filter(|format| format.keeps_columns()) {
            let bytes = format.bytes(&written.cloud, &written.columns);
            let path = Path::new("a").with_extension(format.name());
            assert_eq!(parse_recorded(&path, &bytes).unwrap().0, written, "{format:?}");
            let (points, _) = parse_cloud(&path, &bytes).unwrap();
            assert_eq!(points, written.cloud, "{format:?}");
        }
    }

    #[test]
    fn every_column_of_a_foreign_file_is_kept() {
        let head = "VERSION 0.7\nFIELDS x normal_x y z id _ t desc a#b rgb\n\
                    SIZE 4 4 4 4 8 1 8 4 1 4\nTYPE F F F F U U F F I F\nCOUNT 1 1 1 1 1 3 1 2 1 1\n\
                    WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary\n";
        let head = head.replace("a#b", "a.b");
        let body = [
            &le(&[1.0, 0.5, 2.0, 3.0])[..],
            &(1_u64 << 40).to_le_bytes(),
            &[9; 3],
            &1e-3_f64.to_le_bytes(),
            &le(&[8.0, 8.0]),
            &[0xff],
            &0xff8a_bcde_u32.to_le_bytes(), // as a number it is none
        ];
        let (read, _) = parse_recorded(Path::new("a.pcd"), &bytes(&head, &body.concat())).unwrap();
        assert_eq!(read.left_out, ["desc"]);
        let names: Vec<&str> = read.columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["normal_x", "id", "t", "a.b", "rgb"]);
        let ply = CloudFormat::Ply.bytes(&read.cloud, &read.columns);
        let (again, _) = parse_recorded(Path::new("a.ply"), &ply).unwrap();
        let names: Vec<&str> = again.columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["nx", "id", "t", "a_b", "rgb"]);
        let values: Vec<f64> =
            again.columns[..4].iter().flat_map(|column| column.values()).collect();
        assert_eq!(values, [0.5, 2f64.powi(40), 1e-3, -1.0]);
        assert_eq!(again.columns[4].parts().next().unwrap(), 0xff8a_bcde_u32.to_le_bytes());
        let kitti = parse_recorded(Path::new("a.bin"), &le(&[1.0, 2.0, 3.0, 0.25])).unwrap().0;
        assert_eq!(kitti.columns[0].name, "intensity");
        assert_eq!(kitti.columns[0].values().next(), Some(0.25));
    }

    #[test]
    fn names_that_occur_twice_or_that_no_header_takes_are_changed() {
        let mut columns: Vec<Column> = ["_", "x", "x", "a b\nc", "1st", "nx", "normal_x"]
            .iter()
            .map(|name| RING.column([1.0].into_iter()).named(name))
            .collect();
        columns.push(RING.column([1.0, 2.0].into_iter()));
        let cloud = Cloud::new(vec![[1.0, 2.0, 3.0].into()]);
        let names = |format: CloudFormat| {
            let path = Path::new("a").with_extension(format.name());
            let read = parse_recorded(&path, &format.bytes(&cloud, &columns)).unwrap().0;
            read.columns.into_iter().map(|column| column.name).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(names(CloudFormat::Ply), "__ x_ x__ a_b_c _1st nx nx_");
        assert_eq!(names(CloudFormat::Pcd), "__ x_ x__ a_b_c _1st normal_x normal_x_");
    }

    #[test]
    fn an_attribute_without_exactly_one_number_a_point_is_refused_by_name() {
        let good = ["FIELDS x y z ring", "SIZE 4 4 4 2", "TYPE F F F U", "COUNT 1 1 1 1"];
        let pcd = |line: usize, words: &str| {
            let mut lines = good.map(str::to_owned);
            lines[line] = words.into();
            let head = format!("VERSION 0.7\n{}\nWIDTH 1\nHEIGHT 1\n", lines.join("\n"));
            bytes(&format!("{head}POINTS 1\nDATA ascii\n"), b"1 2 3 4\n\n\n")
        };
        let ply = |property: &str| {
            let head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n\
                        property float y\nproperty float z\n";
            bytes(&format!("{head}property {property}\nend_header\n"), b"1 2 3 4\n")
        };
        assert!(read("good.pcd", &pcd(0, good[0])).is_ok());
        assert!(read("good.ply", &ply("ushort ring")).is_ok());
        let table = [
            ("type.pcd", pcd(2, "TYPE F F F S"), "\"S\""),
            ("count.pcd", pcd(3, "COUNT 1 1 1 2"), "\"ring\", found 2"),
            ("nosize.pcd", pcd(1, "SIZE 4 4 4"), "expected a PCD file"),
            ("size.pcd", pcd(1, "SIZE 4 4 4 3"), "expected a PCD file"),
            ("list.ply", ply("list uchar ushort ring"), "one number a vertex of \"ring\""),
            ("type.ply", ply("half ring"), "expected a PLY file"),
            ("none.ply", ply("ushort"), "expected a PLY file"),
            ("more.ply", ply("ushort ring\nproperty float time"), "expected a PLY file"),
        ];
        for (name, content, expected) in table {
            let message = read(name, &content).expect_err(name).to_string();
            assert!(message.contains(name) && message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_bad_deviation_is_an_error_only_where_there_is_an_echo() {
        let head = "VERSION 0.7\nFIELDS x y z range_sd\nSIZE 4 4 4 4\nTYPE F F F F\n\
                    WIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n";
        let pcd = |rows: &str| read("sd.pcd", &bytes(head, rows.as_bytes()));
        let (cloud, dropped) = pcd("nan nan nan nan\n0 0 0 -1\n1 2 3 0.25\n").unwrap();
        assert_eq!((cloud.range_sd_m, dropped.total()), (Some(vec![0.25]), 2));
        let refusal = pcd("nan nan nan nan\n0 0 1 nan\n1 2 3 0.25\n").unwrap_err().to_string();
        assert!(refusal.contains("range_sd of point 1") && refusal.contains("NaN"), "{refusal}");
    }

    #[test]
    fn the_scans_of_others_read_with_their_point_counts() {
        let Some(data) = echoloop_needs::data_folder("reading others' scans") else { return };
        let table = [
            ("pair_small_gicp/source.ply", 69_792),
            ("pair_ouster/scan_0.ply", 107_647),
            ("pairs_carla/scan_4188.ply", 70_998),
            ("pair_libpointmatcher/cloud.00000.vtk", 24_989),
        ];
        for (file, count) in table {
            let (cloud, dropped) = read_cloud(&data.join(file)).unwrap();
            assert_eq!(cloud.points.len() + dropped.total(), count, "{file}");
        }
    }
}
