use super::*;
use crate::raycast::Raycaster;
use crate::scanner::{self, BeamOptics};
use crate::scene::SceneKind;
use crate::viewpoint::{PairPlan, Split, sample_pairs};

const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                      property float z\n\
                      element face 1\nproperty list uchar int vertex_indices\nend_header\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

fn load(name: &str, content: &[u8]) -> Result<Scene, ImportError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, content).expect("a file");
    load_scene(&path, &ImportOptions { ground: Ground::None, ..ImportOptions::default() })
}

#[test]
fn a_malformed_file_is_refused_by_name_and_reason() {
    let ply = |body: &str| format!("{HEADER}{body}");
    let binary = HEADER.replace("ascii", "binary_little_endian");
    let huge = binary.replace("vertex 4", "vertex 4000000000");
    let big = binary.replace("face 1", "face 18446744073709551615");
    let table: &[(&str, String, &str)] = &[
        ("empty.ply", String::new(), "Unexpected end of file"),
        ("text.ply", "hello\n".into(), "Expected magic number"),
        ("headless.ply", "ply\nformat ascii 1.0\nelement vertex 4\n".into(), "end_header"),
        (
            "pointless.ply",
            "ply\nformat ascii 1.0\nelement face 0\nend_header\n".into(),
            "`element vertex`",
        ),
        (
            "cloud.ply",
            "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n\
                       property float y\nproperty float z\nend_header\n"
                .into(),
            "`element face`",
        ),
        ("flat.ply", HEADER.replace("property float z\n", ""), "x, y and z"),
        (
            "listless.ply",
            HEADER.replace("list uchar int vertex_indices", "int colour"),
            "vertex_indices",
        ),
        ("faceless.ply", HEADER.replace("face 1", "face 0") + SQUARE, "no faces"),
        ("cut.ply", ply(SQUARE), "promises at least"),
        ("short.ply", ply("0 0 0\n"), "promises at least"),
        ("cut_binary.ply", binary.clone() + "0123456789", "promises at least 49 bytes"),
        ("huge.ply", huge, "promises at least"),
        ("big.ply", big, "promises at least"),
        ("endless.ply", binary + &"\u{7f}".repeat(60), "end of file"),
        ("words.ply", ply("0 0 0\n1 0 0\n1 one 0\n0 1 0\n3 0 1 2\n"), "Line 12"),
        ("two.ply", ply(&format!("{SQUARE}2 0 1\n")), "face 0 has 2 corners"),
        (
            "index.ply",
            ply(&format!("{SQUARE}4 0 1 2 4\n")),
            "face 0 names vertex 4, but there are only 4",
        ),
        ("negative.ply", ply(&format!("{SQUARE}3 0 1 -1\n")), "face 0 names vertex -1"),
        ("nan.ply", ply("0 0 0\n1 0 0\n1 NaN 0\n0 1 0\n3 0 1 2\n"), "1 NaN 0"),
        ("inf.ply", ply("0 0 0\n1 0 inf\n1 1 0\n0 1 0\n3 0 1 2\n"), "1 0 inf"),
        ("line.ply", ply("0 0 0\n1 0 0\n2 0 0\n3 0 0\n4 0 1 2 3\n"), "all 2 faces have zero area"),
        (
            "far.ply",
            ply("0 0 0\n1 0 0\n678000 5403500 0\n0 1 0\n3 0 1 2\n"),
            "is its unit the metre",
        ),
        ("empty.obj", String::new(), "no faces"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n".into(), "no faces"),
        (
            "index.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n".into(),
            "face 1 names vertex 3, but there are only 3",
        ),
        ("back.obj", "v 0 0 0\nv 1 0 0\nf -1 -2 -3\n".into(), "face 0 names vertex -1"),
        ("zero.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n".into(), "face 0 names vertex -1"),
        ("words.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf one two three\n".into(), "line 4"),
        ("short.obj", "v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".into(), "position"),
        ("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".into(), "not finite"),
        ("mesh.stl", "solid\n".into(), "is not a STL mesh: end of file before endsolid"),
        ("none.stl", "solid\nendsolid\n".into(), "no faces"),
        ("none.gltf", r#"{"asset":{"version":"2.0"}}"#.into(), "no faces"),
        ("text.gltf", "hello".into(), "is not a glTF mesh: expected value at line 1"),
        ("cut.glb", "glTF\u{2}\0\0\0".into(), "its header is cut short"),
        ("mesh.fbx", "solid\n".into(), "is not a .ply, .obj, .gltf, .glb or .stl file"),
    ];
    for (name, content, reason) in table {
        let error = load(name, content.as_bytes()).expect_err(name).to_string();
        assert!(error.contains(name), "{name}: {error}");
        assert!(error.contains(reason), "{name}: {error}");
        assert!(!error.contains('\n'), "{name}: {error}");
    }
}

/// glTF with a triangle of `size_m` and its buffer in a file of its own.
fn gltf(size_m: f32) -> (String, Vec<u8>) {
    let positions = [0.0, 0.0, 0.0, size_m, 0.0, 0.0, 0.0, size_m, 0.0];
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0,"translation":[0,3,0]}}],
        "meshes":[{{"name":"brick","primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "buffers":[{{"uri":"a%20b.bin","byteLength":36}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                       "min":[0,0,0],"max":[{size_m},{size_m},0]}}]}}"#
    );
    (text, positions.iter().flat_map(|n| f32::to_le_bytes(*n)).collect())
}

#[test]
fn a_gltf_stands_upright_with_its_buffer_from_beside_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("yard.gltf");
    let (text, buffer) = gltf(2.0);
    std::fs::write(&path, text).expect("a file");
    let options = ImportOptions { ground: Ground::None, ..ImportOptions::default() };
    let lost = load_scene(&path, &options).expect_err("no buffer").to_string();
    assert!(lost.contains("buffer \"a%20b.bin\" is not there"), "{lost}");
    assert!(library_files(&path, Libraries::Beside).is_empty());
    std::fs::write(folder.path().join("a b.bin"), buffer).expect("a file");
    let scene = load_scene(&path, &options).expect("a scene");
    // The y axis of the file points up.
    assert_eq!(scene.mesh.vertices, [[0.0, 0.0, 3.0], [2.0, 0.0, 3.0], [0.0, 0.0, 5.0]]);
    assert_eq!(scene.mesh.materials, [Surface::Brick.index()]);
    let files = library_files(&path, Libraries::Beside);
    assert_eq!(files, [folder.path().join("a b.bin").canonicalize().expect("a path")]);
}

#[test]
fn a_gltf_or_stl_of_100_km_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("far.gltf");
    let (text, buffer) = gltf(1e5);
    std::fs::write(&path, text).expect("a file");
    std::fs::write(folder.path().join("a b.bin"), buffer).expect("a file");
    let message = load_scene(&path, &ImportOptions::default()).expect_err("far").to_string();
    assert!(message.contains("it reaches 100003 m"), "{message}");
    let stl = "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 1e5 0 0\nvertex 0 1 0\nendloop\n\
               endfacet\nendsolid\n";
    let message = load("far.stl", stl.as_bytes()).expect_err("far").to_string();
    assert!(message.contains("it reaches 100000 m"), "{message}");
}

#[test]
fn labels_of_faces_or_vertices_are_surfaces_by_the_names_in_comments() {
    let named = HEADER.replace("element vertex", "comment label 3 brick_wall\nelement vertex");
    let of_faces = named.replace(
        "list uchar int vertex_indices",
        "list uchar int vertex_indices\nproperty int label",
    );
    let file = format!("{of_faces}{SQUARE}4 0 1 2 3 3\n");
    let scene = load("faces.ply", file.as_bytes()).expect("a scene");
    assert_eq!(scene.mesh.materials, [Surface::Brick.index(); 2]);
    let of_vertices = named.replace("property float z", "property float z\nproperty uchar label");
    let labelled = "0 0 0 9\n1 0 0 3\n1 1 0 3\n0 1 0 7\n";
    let file = format!("{of_vertices}{labelled}4 0 1 2 3\n");
    let scene = load("vertices.ply", file.as_bytes()).expect("a scene");
    assert_eq!(scene.mesh.materials, [Surface::Brick.index(); 2]);
    let unnamed = file.replace("comment label 3 brick_wall\n", "");
    let scene = load("unnamed.ply", unnamed.as_bytes()).expect("a scene");
    assert_eq!(scene.mesh.materials, [Surface::Unknown.index(); 2]);
}

#[test]
fn a_missing_file_is_named() {
    let error =
        load_scene(Path::new("no/such/town.ply"), &ImportOptions::default()).expect_err("missing");
    assert!(error.to_string().starts_with("cannot read no/such/town.ply"), "{error}");
}

#[test]
fn bytes_that_are_not_text_are_no_obj() {
    let error = load("noise.obj", &[0xff, 0xfe, 0x00, 0x80]).expect_err("noise");
    assert!(error.to_string().contains("expected text"), "{error}");
}

#[test]
fn a_vertex_that_is_not_finite_is_named() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut bytes = HEADER.replace("ascii", "binary_little_endian").into_bytes();
        let coordinates = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, bad, 0.0, 0.0, 1.0, 0.0];
        bytes.extend(coordinates.into_iter().flat_map(f32::to_le_bytes));
        bytes.push(3);
        bytes.extend([0_i32, 1, 2].into_iter().flat_map(i32::to_le_bytes));
        let error = load("bad.ply", &bytes).expect_err("not a point").to_string();
        assert!(error.contains("vertex 2 is not finite"), "{error}");
    }
}

#[test]
fn no_prefix_of_a_file_and_no_flipped_byte_panics() {
    let text = format!("{HEADER}{SQUARE}4 0 1 2 3\n");
    let mut binary = HEADER.replace("ascii", "binary_big_endian").into_bytes();
    for value in SQUARE.split_whitespace() {
        binary.extend(value.parse::<f32>().expect("a number").to_be_bytes());
    }
    binary.push(4);
    binary.extend([0_i32, 1, 2, 3].into_iter().flat_map(i32::to_be_bytes));
    assert_eq!(load("good.ply", &binary).expect("good").mesh.triangles.len(), 2);
    let obj = "mtllib x.mtl\nv 0 0 0\nv 1 0 0\nvt 0 0\nvn 0 0 1\nv 1 1 0\ng wall\n\
               f 1/1/1 2/1/1 -1//1\nf 1 2 3\n";
    // Called directly: a file for each of these would be slow.
    let read_ply = |bytes: &[u8]| drop(ply::read(bytes, Surface::Unknown));
    let read_obj = |bytes: &[u8]| drop(obj::read(bytes, &mut |_| Ok(Vec::new()), Surface::Unknown));
    for_all_damage(text.as_bytes(), read_ply);
    for_all_damage(&binary, read_ply);
    for_all_damage(obj.as_bytes(), read_obj);
}

/// Reads every prefix, and the bytes with each one changed in a few ways.
fn for_all_damage(good: &[u8], read: impl Fn(&[u8])) {
    for k in 0..good.len() {
        read(&good[..k]);
        for flip in [0x01, 0x02, 0x10, 0x20, 0x80, 0xff] {
            let mut bad = good.to_vec();
            bad[k] ^= flip;
            read(&bad);
        }
    }
}

#[test]
fn polygons_become_fans_and_keep_their_surface() {
    let header = HEADER.replace("end_header", "property uchar semantic\nend_header");
    let scene =
        load("square.ply", format!("{header}{SQUARE}4 0 1 2 3 4\n").as_bytes()).expect("a square");
    assert_eq!(scene.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(scene.mesh.materials, [Surface::Glass.index(); 2]);
    assert_eq!(scene.name, "square");
}

#[test]
fn an_obj_names_its_surfaces_and_does_without_its_library() {
    let text = "mtllib lost.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\no red_brick_house\n\
                usemtl lost\nf 1 2 3 4\n";
    let scene = load("house.obj", text.as_bytes()).expect("a house");
    assert_eq!(scene.mesh.triangles.len(), 2);
    assert_eq!(scene.mesh.materials, [Surface::Brick.index(); 2]);
}

#[test]
fn y_up_files_are_turned_and_scaled() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("turned.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 2 3\nf 1 2 3\n").expect("a file");
    let options =
        ImportOptions { ground: Ground::None, scale: 2.0, y_up: true, ..ImportOptions::default() };
    assert_eq!(load_scene(&path, &options).expect("a triangle").mesh.vertices[2], [0.0, -6.0, 4.0]);
}

#[test]
fn a_scene_written_as_ply_comes_back_without_new_ground() {
    let scene = crate::scene::generate(SceneKind::Unstructured, 1);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        scene.mesh.vertices.len(),
        scene.mesh.triangles.len()
    )
    .into_bytes();
    bytes.extend(scene.mesh.vertices.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for triangle in &scene.mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("country.ply");
    std::fs::write(&path, bytes).expect("a file");
    let again = load_scene(&path, &ImportOptions::default()).expect("the same scene");
    assert_eq!(again.mesh.vertices, scene.mesh.vertices);
    assert_eq!(again.mesh.triangles, scene.mesh.triangles);
}

#[test]
fn a_plane_that_is_no_ground_is_refused() {
    let text = "v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n";
    let load = |a, b, c| {
        let ground = Ground::Plane(Plane { a, b, c });
        let options = ImportOptions { ground, ..ImportOptions::default() };
        parse_scene(Path::new("tri.obj"), text.as_bytes(), &options)
    };
    for bad in [
        [1e38, 0.0, 0.0],
        [0.0, -1.5, 0.0],
        [0.0, 0.0, 1e300],
        [0.0, 0.0, f64::NAN],
        [f64::INFINITY, 0.0, 0.0],
    ] {
        let message = load(bad[0], bad[1], bad[2]).expect_err("no ground").to_string();
        assert!(message.contains("must rise by at most 1 m per metre"), "{message}");
    }
    let scene = load(0.5, -1.0, -5000.0).expect("steep, but ground");
    assert!(scene.mesh.vertices.iter().flatten().all(|x| x.is_finite()));
}

#[test]
fn a_mesh_names_no_library_of_another_folder() {
    let text = "mtllib ../a.mtl\nv 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n";
    let message = load("tri.obj", text.as_bytes()).expect_err("another folder").to_string();
    assert!(message.contains("line 1: mtllib \"../a.mtl\" lies in another folder"), "{message}");
    assert!(message.contains("scene.libraries"), "{message}");
}

fn assert_scannable(scene: &Scene, split: Split) {
    let caster = Raycaster::new(scene);
    let plan = PairPlan { count: 4, split, ..PairPlan::default() };
    let pairs = sample_pairs(scene, &caster, &plan).unwrap_or_else(|error| panic!("{error}"));
    let beam = |k: u32| {
        let (turn, up) = (f64::from(k % 90) * 0.035 - 1.57, f64::from(k / 90) * 0.05 - 0.3);
        [libm::cos(up) * libm::cos(turn), libm::cos(up) * libm::sin(turn), libm::sin(up)]
            .map(|x| x as f32)
    };
    let directions: Vec<[f32; 3]> = (0..1800).map(beam).collect();
    for pair in pairs {
        let pose = pair.world_from_first;
        let response =
            scanner::scan(&caster, &scene.materials, &pose, &directions, &BeamOptics::default());
        let answered = (0..response.len()).filter(|&b| !response.of(b).is_empty()).count();
        assert!(answered > 600, "{}: {answered} of 1800 beams return", scene.name);
    }
}

#[test]
fn ingolstadt_gets_its_street_and_can_be_scanned() {
    let Some(folder) = echoloop_needs::data_folder("the street of Ingolstadt") else {
        return;
    };
    let path = folder.join("city_ingolstadt/ingolstadt_north.ply");
    let bare =
        load_scene(&path, &ImportOptions { ground: Ground::None, ..ImportOptions::default() })
            .expect("the city");
    assert_eq!(bare.mesh.triangles.len(), 83_146);
    assert!(!ground::has_ground(&bare.mesh));
    // The plane and its residual as in the README of the data.
    let (found, known) = (ground::fit(&bare.mesh), Plane { a: 0.002_60, b: 0.012_17, c: -3.093 });
    let (low, high) = bare.area;
    for [x, y] in
        [[low[0], low[1]], [low[0], high[1]], [high[0], low[1]], [high[0], high[1]], [107.5, 410.3]]
    {
        let apart = found.height(x.into(), y.into()) - known.height(x.into(), y.into());
        eprintln!("Ingolstadt's ground at ({x}, {y}) is {apart:+.3} m from the known plane");
        assert!(apart.abs() < 0.46, "{apart} m at ({x}, {y}): {found:?}");
    }
    let scene = load_scene(&path, &ImportOptions::default()).expect("the city on its ground");
    let plaster = scene.mesh.materials.iter().filter(|&&m| m == Surface::Plaster.index()).count();
    assert!(plaster > 5_000, "{plaster} faces of wall");
    for split in [Split::Train, Split::Test] {
        assert_scannable(&scene, split);
    }
}

#[test]
fn imported_worlds_keep_their_ground_and_can_be_scanned() {
    let Some(folder) = echoloop_needs::data_folder("the agriculture and inspection worlds") else {
        return;
    };
    for name in ["agriculture_world", "inspection_world"] {
        let path = folder.join(format!("gazebo_scenes/{name}.ply"));
        let scene = load_scene(&path, &ImportOptions::default()).expect(name);
        let asphalt =
            scene.mesh.materials.iter().filter(|&&m| m == Surface::Asphalt.index()).count();
        assert_eq!(asphalt, 0, "{name} got ground although it has some");
        assert_scannable(&scene, Split::Test);
    }
}

#[test]
fn single_objects_get_ground_to_stand_on() {
    let Some(folder) = echoloop_needs::data_folder("houses, shops and trees of others") else {
        return;
    };
    for (name, scale) in [
        ("gazebo_scenes/house_1", 1.0),
        ("gazebo_scenes/gas_station", 1.0),
        ("trees/oak_medium", 0.2),
    ] {
        let path = folder.join(format!("{name}.ply"));
        let scene =
            load_scene(&path, &ImportOptions { scale, ..ImportOptions::default() }).expect(name);
        assert!(
            scene.mesh.materials.contains(&Surface::Asphalt.index()),
            "{name} hangs in the air"
        );
        let trees = scene.mesh.materials.iter().filter(|&&m| m == Surface::Leaf.index()).count();
        assert_eq!(trees > 1000, name.starts_with("trees"), "{name}: {trees} leaves");
    }
}
