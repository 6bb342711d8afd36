//! The walls of cavities that no label fills, so that these keep their volumes as if they were labels: chords of a wall lie within
//! its cavity, and what a label around it wins by that made up for what it lost outside.

use super::super::vec3::{V3, cross, dot, sub};
use super::super::voids::ends;
use super::work::Work;
use monro_geometry::DisjointSets;
use std::collections::BTreeMap;

/// Walls in the outer surface, each numbered as a label after the others.
#[derive(Debug, Default)]
pub(super) struct Walls {
    /// Volumes of the cavities, mm3.
    pub(super) wanted: Vec<f64>,
    /// Their walls, seen from within the tissue.
    faces: Vec<Vec<[u32; 3]>>,
    /// The number of each point in one.
    numbers: BTreeMap<u32, u8>,
}

impl Walls {
    /// Volumes now, mm3.
    pub(super) fn volumes(&self, points: &[V3]) -> Vec<f64> {
        self.faces.iter().map(|faces| -volume(faces, points)).collect()
    }

    /// The number of the cavity that a point is in the wall of.
    pub(super) fn of(&self, point: u32) -> Option<u8> {
        self.numbers.get(&point).copied()
    }
}

/// Volume within faces seen from outside, mm3; negative where they are seen from within.
fn volume(faces: &[[u32; 3]], points: &[V3]) -> f64 {
    let from = faces.first().map_or([0.0; 3], |f| points[f[0] as usize]);
    let of = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| sub(points[v as usize], from));
        dot(a, cross(b, c)) / 6.0
    };
    faces.iter().map(of).sum()
}

impl Work<'_> {
    /// The walls of the cavities of the fields, after so many labels. `faces` are those of all surfaces, and whether of the outer one.
    pub(super) fn walls(&self, faces: &[([u32; 3], bool)], labels: usize) -> Walls {
        let mut walls = Walls::default();
        if self.fields.voids.is_empty() {
            return walls;
        }
        let mut free: Vec<_> = self.fields.voids.iter().collect();
        for faces in self.outer_parts(faces) {
            let found = -volume(&faces, &self.points);
            let Some([low, high]) = ends(faces.iter().flatten().map(|&v| self.points[v as usize])) else { continue };
            let Some(which) = free.iter().position(|v| v.is_like(found, low, high)) else { continue };
            let Ok(number) = u8::try_from(labels + walls.wanted.len()) else { break };
            walls.wanted.push(free.remove(which).volume);
            walls.numbers.extend(faces.iter().flatten().map(|&v| (v, number)));
            walls.faces.push(faces);
        }
        walls
    }

    /// The parts of the outer surface that have no point in common.
    fn outer_parts(&self, faces: &[([u32; 3], bool)]) -> Vec<Vec<[u32; 3]>> {
        let outer = || faces.iter().filter(|(_, outer)| *outer).map(|(f, _)| *f);
        let mut sets = DisjointSets::new(self.points.len());
        outer().for_each(|[a, b, c]| [b, c].into_iter().for_each(|other| sets.join(a, other)));
        let mut parts: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
        outer().for_each(|f| parts.entry(sets.root(f[0])).or_default().push(f));
        parts.into_values().collect()
    }
}
