//! Making each label's surface two-manifold after the cuts, and dropping crumbs.

use super::cut::{Incidence, OUTSIDE, RawMesh, drop_outside};

/// Rounds at most; each may uncover a few new places.
const ROUNDS: usize = 24;
/// Rounds in which as little as possible is relabelled. Two labels may then pass elements to and fro for ever; later rounds
/// give all that is around such a point to one of them.
const GENTLE: usize = 6;

/// Relabels the smaller part wherever a label (or what lies around it) meets itself in a point or edge only, and pieces
/// of a label too small to matter: below `crumb` mm3 and a hundredth of the label.
///
/// Returns the pieces given away.
pub(super) fn repair(mesh: &mut RawMesh, labels: u8, crumb: f64) -> Vec<Crumb> {
    let mut given = Vec::new();
    for round in 0..ROUNDS {
        let changed = crumbs(mesh, labels, crumb, if round == 0 { Some(&mut given) } else { None })
            + pinches(mesh, round >= GENTLE);
        if mesh.labels.contains(&OUTSIDE) {
            drop_outside(mesh);
        }
        if changed == 0 && round > 0 {
            break;
        }
    }
    given
}

/// A separate piece of a label that was too small to keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crumb {
    /// Index of the label.
    pub(super) label: u8,
    /// Volume, mm3.
    pub(super) volume: f64,
}

/// "No element": the outside.
const OUT: u32 = u32::MAX;

/// Every face of every element, sorted: equal faces follow each other.
fn sorted_faces(mesh: &RawMesh) -> Vec<([u32; 3], u32)> {
    const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
    let mut faces: Vec<([u32; 3], u32)> = Vec::with_capacity(mesh.tets.len() * 4);
    for (i, t) in mesh.tets.iter().enumerate() {
        for f in FACES {
            let mut key = f.map(|c| t[c]);
            key.sort_unstable();
            faces.push((key, i as u32));
        }
    }
    faces.sort_unstable();
    faces
}

/// Elements on the two sides of each face.
fn face_pairs(mesh: &RawMesh) -> Vec<(u32, u32)> {
    let faces = sorted_faces(mesh);
    faces.chunk_by(|a, b| a.0 == b.0).map(|c| (c[0].1, c.get(1).map_or(OUT, |x| x.1))).collect()
}

fn volume(mesh: &RawMesh, t: u32) -> f64 {
    super::vec3::volume6(mesh.corners(mesh.tets[t as usize])) / 6.0
}

/// Gives small separate pieces of a label to their commonest neighbour, and lists them.
fn crumbs(mesh: &mut RawMesh, labels: u8, crumb: f64, list: Option<&mut Vec<Crumb>>) -> usize {
    let pairs = face_pairs(mesh);
    let mut sets = Sets::new(mesh.tets.len());
    for &(a, b) in pairs.iter().filter(|p| p.1 != OUT) {
        if mesh.labels[a as usize] == mesh.labels[b as usize] {
            sets.join(a, b);
        }
    }
    let mut size = vec![0.0; mesh.tets.len()];
    let mut whole = vec![0.0; usize::from(labels)];
    for t in 0..mesh.tets.len() as u32 {
        let v = volume(mesh, t);
        size[sets.root(t) as usize] += v;
        whole[usize::from(mesh.labels[t as usize])] += v;
    }
    let roots: Vec<u32> = (0..mesh.tets.len() as u32).map(|t| sets.root(t)).collect();
    let small = |t: u32, labels: &[u8]| {
        let s = size[roots[t as usize] as usize];
        s < crumb && s < 0.01 * whole[usize::from(labels[t as usize])]
    };
    if let Some(list) = list {
        let roots = (0..mesh.tets.len() as u32).filter(|&t| size[t as usize] > 0.0 && small(t, &mesh.labels));
        list.extend(roots.map(|t| Crumb { label: mesh.labels[t as usize], volume: size[t as usize] }));
    }
    let mut new: Vec<(u32, u8)> = Vec::new();
    for &(a, b) in &pairs {
        let other = |x: u32| if x == OUT { OUTSIDE } else { mesh.labels[x as usize] };
        if b == OUT || mesh.labels[a as usize] != mesh.labels[b as usize] {
            if small(a, &mesh.labels) {
                new.push((a, other(b)));
            }
            if b != OUT && small(b, &mesh.labels) {
                new.push((b, other(a)));
            }
        }
    }
    // Element by element from the rim inwards; the rounds do the rest. Inner labels are preferred to the outside.
    new.sort_unstable();
    new.dedup_by_key(|x| x.0);
    new.iter().for_each(|&(t, l)| mesh.labels[t as usize] = l);
    new.len()
}

/// Relabels the smaller part of a label, or of its complement, around each point where it is in two pieces.
fn pinches(mesh: &mut RawMesh, firmly: bool) -> usize {
    let around = Incidence::new(mesh);
    let outer = outer_faces(mesh);
    let mut changed = 0;
    for v in 0..mesh.points.len() as u32 {
        let star = around.of(v);
        let first = mesh.labels[star[0] as usize];
        let on_rim = outer.binary_search_by_key(&v, |f| f.0).is_ok();
        if !on_rim && star.iter().all(|&t| mesh.labels[t as usize] == first) {
            continue;
        }
        changed += usize::from(unpinch(mesh, v, star, &outer, firmly));
    }
    changed
}

/// `(point, element)` of outer faces, sorted: the element has an outer face at the point.
fn outer_faces(mesh: &RawMesh) -> Vec<(u32, u32)> {
    let faces = sorted_faces(mesh);
    let single = faces.chunk_by(|a, b| a.0 == b.0).filter(|c| c.len() == 1).map(|c| c[0]);
    let mut out: Vec<(u32, u32)> = single.flat_map(|(face, t)| face.map(|v| (v, t))).collect();
    out.sort_unstable();
    out.dedup();
    out
}

/// Looks at one point; true if something was relabelled.
fn unpinch(mesh: &mut RawMesh, v: u32, star: &[u32], outer: &[(u32, u32)], firmly: bool) -> bool {
    let mut labels: Vec<u8> = star.iter().map(|&t| mesh.labels[t as usize]).collect();
    labels.sort_unstable();
    let kept = labels.chunk_by(|a, b| a == b).filter(|c| c[0] != OUTSIDE);
    let commonest = kept.max_by_key(|c| c.len()).map(|c| c[0]);
    labels.dedup();
    let several = labels.len() > 1;
    for l in labels {
        let inside = |t: u32| mesh.labels[t as usize] == l;
        // The outside is one more element, after the last, that belongs to the complement.
        let n = star.len();
        let mut sets = Sets::new(n + 1);
        for a in 0..n {
            for b in a + 1..n {
                if inside(star[a]) == inside(star[b]) && share_face(mesh, star[a], star[b]) {
                    sets.join(a as u32, b as u32);
                }
            }
            if !inside(star[a]) && outer.binary_search(&(v, star[a])).is_ok() {
                sets.join(a as u32, n as u32);
            }
        }
        let has_outside = outer.binary_search_by_key(&v, |f| f.0).is_ok();
        let mut pieces: Vec<(f64, u32, bool)> = Vec::new();
        for a in 0..n as u32 {
            let root = sets.root(a);
            let size = volume(mesh, star[a as usize]);
            match pieces.iter_mut().find(|p| p.1 == root) {
                Some(p) => p.0 += size,
                None => pieces.push((size, root, inside(star[a as usize]))),
            }
        }
        let outside_root = sets.root(n as u32);
        let count = |side: bool| pieces.iter().filter(|p| p.2 == side).count();
        let extra = usize::from(has_outside && !pieces.iter().any(|p| p.1 == outside_root));
        let side = match (count(true) > 1, count(false) + extra > 1) {
            (true, _) => true,
            (false, true) => false,
            _ => continue,
        };
        if let (true, true, Some(to)) = (firmly, several, commonest) {
            star.iter().for_each(|&t| mesh.labels[t as usize] = to);
            return true;
        }
        // The piece joined with the outside cannot be filled.
        let smallest = pieces
            .iter()
            .filter(|p| p.2 == side && (side || !has_outside || p.1 != outside_root))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let Some(&(_, root, _)) = smallest else { continue };
        let to = if side { other_label(mesh, star, l) } else { l };
        for a in 0..n as u32 {
            if sets.root(a) == root {
                mesh.labels[star[a as usize] as usize] = to;
            }
        }
        return true;
    }
    false
}

/// The label with most elements around a point besides `l`; the outside if there is none.
fn other_label(mesh: &RawMesh, star: &[u32], l: u8) -> u8 {
    let mut others: Vec<u8> = star.iter().map(|&t| mesh.labels[t as usize]).filter(|&x| x != l).collect();
    others.sort_unstable();
    others.chunk_by(|a, b| a == b).max_by_key(|c| c.len()).map_or(OUTSIDE, |c| c[0])
}

fn share_face(mesh: &RawMesh, a: u32, b: u32) -> bool {
    let other = mesh.tets[b as usize];
    mesh.tets[a as usize].iter().filter(|v| other.contains(v)).count() == 3
}

struct Sets(Vec<u32>);

impl Sets {
    fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
