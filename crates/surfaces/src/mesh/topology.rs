//! How the triangles of a mesh are connected: by edges of two triangles each, turned the same way.

use std::collections::HashMap;

use glam::DVec3;

use super::{MeshError, triangle::Triangle};

/// An edge that does not belong to two triangles: its ends, and the number of its triangles.
pub(super) type OpenEdge = (DVec3, DVec3, usize);

/// Turns triangles so that neighbors have their normals on the same side. Returns the first edge that does
/// not belong to two triangles; `None` if the mesh closes a volume.
///
/// # Errors
/// A mesh of one side only, such as a Möbius strip.
pub(super) fn orient(triangles: &mut [Triangle]) -> Result<Option<OpenEdge>, MeshError> {
    // Corners are equal by their bits; 0 and −0 are one number.
    let mut numbers: HashMap<[u64; 3], u32> = HashMap::with_capacity(triangles.len());
    let mut number = |corner: DVec3| {
        let next = numbers.len() as u32;
        *numbers.entry((corner + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert(next)
    };
    let corners: Vec<[u32; 3]> = triangles.iter().map(|triangle| triangle.corners.map(&mut number)).collect();
    let mut edges: HashMap<[u32; 2], Vec<(u32, bool)>> = HashMap::with_capacity(2 * triangles.len());
    for (face, corners) in corners.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            edges.entry([a.min(b), a.max(b)]).or_default().push((face as u32, a < b));
        }
    }
    let all = (0..triangles.len()).flat_map(|face| [0, 1, 2].map(|k| (face, k)));
    let mut open_edges = all.filter_map(|(face, k)| {
        let (a, b) = (corners[face][k], corners[face][(k + 1) % 3]);
        let count = edges[&[a.min(b), a.max(b)]].len();
        let [from, to] = [k, (k + 1) % 3].map(|k| triangles[face].corners[k]);
        (count != 2).then_some((from, to, count))
    });
    let open_edge = open_edges.next();
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut open = Vec::new();
    for start in 0..triangles.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        open.push(start);
        while let Some(face) = open.pop() {
            let own = turned[face] == Some(true);
            for k in 0..3 {
                let (a, b) = (corners[face][k], corners[face][(k + 1) % 3]);
                let faces = &edges[&[a.min(b), a.max(b)]];
                // Where three meet, no side is common.
                if faces.len() != 2 {
                    continue;
                }
                let here = (a < b) != own;
                for &(other, forward) in faces.iter().filter(|(other, _)| *other as usize != face) {
                    // Neighbors run through their edge in opposite directions.
                    let wanted = forward == here;
                    match turned[other as usize] {
                        None => {
                            turned[other as usize] = Some(wanted);
                            open.push(other as usize);
                        }
                        Some(found) if found != wanted => {
                            let [from, to] = [k, (k + 1) % 3].map(|k| triangles[face].corners[k]);
                            return Err(MeshError::NotOrientable { from, to });
                        }
                        Some(_) => {}
                    }
                }
            }
        }
    }
    for (triangle, turned) in triangles.iter_mut().zip(turned) {
        if turned == Some(true) {
            triangle.corners.swap(1, 2);
            triangle.normal = -triangle.normal;
        }
    }
    Ok(open_edge)
}
