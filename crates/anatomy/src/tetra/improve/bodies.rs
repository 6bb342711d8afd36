//! Bodies that are no labels and are to keep their volumes as if they were: cavities that no label fills, for chords of a wall lie
//! within its cavity, and what a label around it wins by that made up for what it lost outside; and separate pieces of one label,
//! of which the largest made up for what the small ones lost.

use super::super::bodies::{Body, ends};
use super::relax::Pair;
use super::work::{DEAD, Work};
use monro_geometry::DisjointSets;
use monro_geometry::d3::{D3, cross, dot, sub, volume6};
use std::collections::BTreeMap;

/// Labels, and after them the other bodies, each numbered as one.
#[derive(Debug, Default)]
pub(super) struct Bodies {
    /// Volumes, mm3; of a label that of what no other body has of it.
    pub(super) wanted: Vec<f64>,
    labels: usize,
    /// The walls of the cavities, seen from within the tissue.
    walls: Vec<Vec<[u32; 3]>>,
    /// The number of the cavity of each point in a wall.
    of_wall: BTreeMap<u32, u8>,
    /// The number of the piece of each point and label.
    of_piece: BTreeMap<(u32, u8), u8>,
}

/// Elements of one label that have no point in common with the others.
struct Part {
    points: Vec<u32>,
    volume: f64,
}

impl Bodies {
    /// Whether a body is none of those that all others wait for.
    pub(super) fn is_minor(&self, number: usize, specks: &[bool]) -> bool {
        number >= self.labels + self.walls.len() || specks.get(number) == Some(&true)
    }

    /// What two bodies the surface with a point between two labels parts.
    pub(super) fn between(&self, point: u32, (a, b): Pair) -> Pair {
        let of = |label: u8| self.of_piece.get(&(point, label)).copied().unwrap_or(label);
        (of(a), b.map(of).or_else(|| self.of_wall.get(&point).copied()))
    }

    /// Adds the walls of a cavity.
    fn add_cavity(&mut self, volume: f64, faces: Vec<[u32; 3]>) {
        let Some(number) = self.number() else { return };
        self.wanted.push(volume);
        self.of_wall.extend(faces.iter().flatten().map(|&v| (v, number)));
        self.walls.push(faces);
    }

    /// Adds a piece of a label.
    fn add_piece(&mut self, label: u8, volume: f64, points: &[u32]) {
        let Some(number) = self.number() else { return };
        self.wanted[usize::from(label)] -= volume;
        self.wanted.push(volume);
        self.of_piece.extend(points.iter().map(|&v| ((v, label), number)));
    }

    /// The number of one more.
    fn number(&self) -> Option<u8> {
        u8::try_from(self.wanted.len()).ok().filter(|&n| n < DEAD)
    }
}

/// Volume within faces seen from outside, mm3; negative where they are seen from within.
fn volume(faces: &[[u32; 3]], points: &[D3]) -> f64 {
    let from = faces.first().map_or([0.0; 3], |f| points[f[0] as usize]);
    let of = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| sub(points[v as usize], from));
        dot(a, cross(b, c)) / 6.0
    };
    faces.iter().map(of).sum()
}

impl Work<'_> {
    /// The bodies of the fields, with the volumes `wanted` of the labels. `faces` are those of all surfaces, and whether of the outer
    /// one.
    pub(super) fn bodies(&self, faces: &[([u32; 3], bool)], wanted: &[f64]) -> Bodies {
        let mut bodies = Bodies { wanted: wanted.to_vec(), labels: wanted.len(), ..Bodies::default() };
        let at = |v: &u32| self.points[*v as usize];
        let mut free: Vec<&Body> = self.fields.voids.iter().collect();
        for faces in if free.is_empty() { Vec::new() } else { self.outer_parts(faces) } {
            let found = -volume(&faces, &self.points);
            let Some(ends) = ends(faces.iter().flatten().map(at)) else { continue };
            if let Some(which) = free.iter().position(|v| v.is_like(found, ends)) {
                bodies.add_cavity(free.remove(which).volume, faces);
            }
        }
        for (label, pieces) in (0..).zip(&self.fields.pieces).filter(|(_, pieces)| !pieces.is_empty()) {
            let mut parts = self.parts(label);
            for piece in pieces {
                let off = |p: &Part| {
                    let ends = ends(p.points.iter().map(at)).filter(|&ends| piece.is_like(p.volume, ends))?;
                    Some(piece.distance(ends))
                };
                let offs = parts.iter().map(off).enumerate().filter_map(|(i, off)| Some((i, off?)));
                let Some((nearest, _)) = offs.min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
                bodies.add_piece(label, piece.volume, &parts.remove(nearest).points);
            }
        }
        bodies
    }

    /// Volumes now, mm3.
    pub(super) fn body_volumes(&self, bodies: &Bodies) -> Vec<f64> {
        let mut v = vec![0.0; bodies.wanted.len()];
        for (t, &l) in self.tets.iter().zip(&self.labels).filter(|(_, l)| **l != DEAD) {
            let body = if bodies.of_piece.is_empty() { l } else { bodies.between(t[0], (l, None)).0 };
            v[usize::from(body)] += volume6(self.corners(*t)) / 6.0;
        }
        let walls = bodies.walls.iter().map(|faces| -volume(faces, &self.points));
        v[bodies.labels..].iter_mut().zip(walls).for_each(|(v, wall)| *v = wall);
        v
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

    /// The parts of a label but for the largest.
    fn parts(&self, label: u8) -> Vec<Part> {
        let own = || self.tets.iter().zip(&self.labels).filter(|(_, l)| **l == label).map(|(t, _)| *t);
        let mut sets = DisjointSets::new(self.points.len());
        own().for_each(|[a, others @ ..]| others.into_iter().for_each(|other| sets.join(a, other)));
        let mut parts: BTreeMap<u32, Part> = BTreeMap::new();
        for t in own() {
            let part = parts.entry(sets.root(t[0])).or_insert(Part { points: Vec::new(), volume: 0.0 });
            part.points.extend(t);
            part.volume += volume6(self.corners(t)) / 6.0;
        }
        let mut parts: Vec<Part> = parts.into_values().collect();
        parts.sort_by(|a, b| b.volume.total_cmp(&a.volume));
        parts.drain(..parts.len().min(1));
        parts
    }
}
