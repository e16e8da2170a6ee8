//! OBJ: tobj reads it; faces are checked first, because tobj does not say which one is wrong.

use std::path::Path;

use super::fault::Fault;
use crate::scene::{Mesh, MeshFault, Surface};

pub(super) fn read(bytes: &[u8], folder: Option<&Path>, default: Surface) -> Result<Mesh, Fault> {
    check_faces(bytes)?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // A missing library is no reason to refuse a mesh: names of materials are a hint.
    let library = |name: &Path| tobj::load_mtl(folder.unwrap_or(Path::new(".")).join(name));
    let (models, materials) = tobj::load_obj_buf(&mut &bytes[..], &options, library)
        .map_err(|error| Fault::Format(format!("{error}; expected v and f lines")))?;
    let materials = materials.unwrap_or_default();
    let mut mesh = Mesh::default();
    for model in &models {
        let library =
            model.mesh.material_id.and_then(|id| materials.get(id)).map(|m| m.name.as_str());
        let names = [library, Some(model.name.as_str())];
        let surface =
            names.into_iter().flatten().find_map(Surface::from_loose_name).unwrap_or(default);
        mesh.append(&Mesh {
            vertices: model.mesh.positions.as_chunks().0.to_vec(),
            triangles: model.mesh.indices.as_chunks().0.to_vec(),
            materials: vec![surface.index(); model.mesh.indices.len() / 3],
        });
    }
    Ok(mesh)
}

/// Every face has three corners or more, and each is a vertex of the file.
fn check_faces(bytes: &[u8]) -> Result<(), Fault> {
    let text =
        std::str::from_utf8(bytes).map_err(|e| Fault::Format(format!("expected text: {e}")))?;
    let vertices = text.lines().filter(|line| line.trim_start().starts_with("v ")).count();
    let (mut before, mut face) = (0, 0);
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => before += 1,
            Some("f") => {
                let corners = words.map(|word| corner(word, before)).collect::<Option<Vec<i64>>>();
                check_face(corners, face, number + 1, vertices)?;
                face += 1;
            }
            _ => {}
        }
    }
    Ok(())
}

fn check_face(
    corners: Option<Vec<i64>>,
    face: usize,
    line: usize,
    vertices: usize,
) -> Result<(), Fault> {
    let Some(corners) = corners.filter(|corners| corners.len() >= 3) else {
        return Err(Fault::Format(format!(
            "line {line}: expected a face of three or more vertex numbers"
        )));
    };
    match corners.into_iter().find(|&index| index < 0 || index >= vertices as i64) {
        Some(index) => Err(MeshFault::IndexOutOfRange { face, index, vertices }.into()),
        None => Ok(()),
    }
}

/// Index from 0 of "7", "7/1", "7//2" or, counted backwards, "-1".
fn corner(word: &str, before: i64) -> Option<i64> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    Some(if number < 0 { before + number } else { number - 1 })
}
