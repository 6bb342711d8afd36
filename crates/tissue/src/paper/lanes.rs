//! The three constraints that fill a mesh, eight at a time: edges (6), and for each element its springs (11) and then its
//! volume (10). The plain functions of `constraints` are the truth; a test holds the two together.
//!
//! Constraints of a batch share no vertex, so a batch is eight Gauss-Seidel steps at once. Loops over lanes become vector
//! instructions of whatever width the processor has (see `simd`), with the same bits whatever the width.

const LANES: usize = 8;
type Lane = [f32; LANES];

/// How many unfinished batches are looked through for a place.
const OPEN: usize = 24;

/// Groups `0..count` so that the members of a group share no vertex: up to eight each, near each other in order.
fn groups<const N: usize>(nodes: &[[u32; N]]) -> Vec<Vec<u32>> {
    let (mut open, mut done): (Vec<Vec<u32>>, Vec<Vec<u32>>) = (Vec::new(), Vec::new());
    for (i, own) in nodes.iter().enumerate() {
        let clashes = |group: &Vec<u32>| group.iter().any(|&o| nodes[o as usize].iter().any(|v| own.contains(v)));
        match open.iter().position(|g| !clashes(g)) {
            Some(g) => {
                open[g].push(i as u32);
                if open[g].len() == LANES {
                    done.push(open.remove(g));
                }
            }
            None => {
                if open.len() == OPEN {
                    done.push(open.remove(0));
                }
                open.push(vec![i as u32]);
            }
        }
    }
    done.append(&mut open);
    done
}

/// Eight edges. Empty places repeat the first and have no stiffness.
#[derive(Debug, Clone, Copy)]
struct EdgeBatch {
    nodes: [[u32; LANES]; 2],
    rest: Lane,
    /// Constraint of each lane; the first one again in an empty place.
    source: [u32; LANES],
    count: usize,
}

/// Eight elements.
#[derive(Debug, Clone, Copy)]
struct TetBatch {
    nodes: [[u32; LANES]; 4],
    /// Distance of each corner from the centroid at rest, mm.
    springs: [Lane; 4],
    /// Volume at rest, mm3.
    volume: Lane,
    source: [u32; LANES],
    count: usize,
}

/// All edges of a mesh, in batches.
#[derive(Debug, Clone, Default)]
pub(super) struct Edges(Vec<EdgeBatch>);

/// All elements of a mesh, in batches.
#[derive(Debug, Clone, Default)]
pub(super) struct Tets(Vec<TetBatch>);

/// Four coordinates (the fourth is the inverse mass) of eight vertices.
type Corner = [Lane; 4];

#[inline(always)]
fn gather(nodes: &[u32; LANES], from: &[[f32; 4]]) -> Corner {
    let mut out = [[0f32; LANES]; 4];
    for l in 0..LANES {
        let p = from[nodes[l] as usize];
        for a in 0..4 {
            out[a][l] = p[a];
        }
    }
    out
}

#[inline(always)]
fn scatter(nodes: &[u32; LANES], count: usize, corner: &Corner, to: &mut [[f32; 4]]) {
    for l in 0..count {
        to[nodes[l] as usize] = [corner[0][l], corner[1][l], corner[2][l], corner[3][l]];
    }
}

#[inline(always)]
fn pick(values: &[f32], source: &[u32; LANES]) -> Lane {
    let mut out = [0f32; LANES];
    for l in 0..LANES {
        out[l] = values[source[l] as usize];
    }
    out
}

#[inline(always)]
fn largest(motion: &Lane, count: usize, most: f32) -> f32 {
    motion[..count].iter().fold(most, |m, v| m.max(*v))
}

/// Nothing instead of a step that is not a number: no free vertex, or no gradient.
#[inline(always)]
fn sane(step: f32) -> f32 {
    if step.is_finite() { step } else { 0.0 }
}

impl Edges {
    pub(super) fn new(nodes: &[[u32; 2]], rest: &[f32]) -> Self {
        let batch = |g: &Vec<u32>| {
            let source: [u32; LANES] = core::array::from_fn(|l| g[if l < g.len() { l } else { 0 }]);
            EdgeBatch {
                nodes: core::array::from_fn(|k| source.map(|s| nodes[s as usize][k])),
                rest: source.map(|s| rest[s as usize]),
                source,
                count: g.len(),
            }
        };
        Self(groups(nodes).iter().map(batch).collect())
    }

    /// One pass; returns the square of the largest motion.
    #[inline(always)]
    pub(super) fn project(&self, positions: &mut [[f32; 4]], stiffness: &[f32]) -> f32 {
        let mut most = 0f32;
        for b in &self.0 {
            let (mut p, mut q) = (gather(&b.nodes[0], positions), gather(&b.nodes[1], positions));
            let k = pick(stiffness, &b.source);
            let mut motion = [0f32; LANES];
            for l in 0..LANES {
                let d = [p[0][l] - q[0][l], p[1][l] - q[1][l], p[2][l] - q[2][l]];
                let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                let s = sane(k[l] * (length - b.rest[l]) / (length * (p[3][l] + q[3][l])));
                let (wp, wq) = (s * p[3][l], s * q[3][l]);
                for a in 0..3 {
                    p[a][l] -= wp * d[a];
                    q[a][l] += wq * d[a];
                }
                let far = wp.abs().max(wq.abs()) * length;
                motion[l] = far * far;
            }
            scatter(&b.nodes[0], b.count, &p, positions);
            scatter(&b.nodes[1], b.count, &q, positions);
            most = largest(&motion, b.count, most);
        }
        most
    }
}

impl Tets {
    pub(super) fn new(nodes: &[[u32; 4]], springs: &[[f32; 4]], volume: &[f32]) -> Self {
        let batch = |g: &Vec<u32>| {
            let source: [u32; LANES] = core::array::from_fn(|l| g[if l < g.len() { l } else { 0 }]);
            TetBatch {
                nodes: core::array::from_fn(|k| source.map(|s| nodes[s as usize][k])),
                springs: core::array::from_fn(|k| source.map(|s| springs[s as usize][k])),
                volume: source.map(|s| volume[s as usize]),
                source,
                count: g.len(),
            }
        };
        Self(groups(nodes).iter().map(batch).collect())
    }

    /// One pass over springs and volumes; returns the square of the largest motion.
    #[inline(always)]
    pub(super) fn project(&self, positions: &mut [[f32; 4]], springs: &[f32], volumes: &[f32]) -> f32 {
        let mut most = 0f32;
        for b in &self.0 {
            let mut p = [0, 1, 2, 3].map(|i| gather(&b.nodes[i], positions));
            let before = p;
            pull(&mut p, &b.springs, &pick(springs, &b.source));
            inflate(&mut p, &b.volume, &pick(volumes, &b.source));
            for i in 0..4 {
                let mut motion = [0f32; LANES];
                for l in 0..LANES {
                    let d = [0, 1, 2].map(|a| p[i][a][l] - before[i][a][l]);
                    motion[l] = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                }
                most = largest(&motion, b.count, most);
                scatter(&b.nodes[i], b.count, &p[i], positions);
            }
        }
        most
    }
}

/// Equation (11) on eight elements.
#[inline(always)]
fn pull(p: &mut [Corner; 4], rest: &[Lane; 4], k: &Lane) {
    for l in 0..LANES {
        let q = [0, 1, 2].map(|a| ((p[0][a][l] + p[1][a][l]) + (p[2][a][l] + p[3][a][l])) * 0.25);
        let (mut value, mut pulls, mut sum) = (0f32, [[0f32; 3]; 4], [0f32; 3]);
        for i in 0..4 {
            let d = [0, 1, 2].map(|a| p[i][a][l] - q[a]);
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let stretch = length - rest[i][l];
            value += 0.5 * stretch * stretch;
            let share = sane(stretch / length);
            for a in 0..3 {
                pulls[i][a] = d[a] * share;
                sum[a] += pulls[i][a];
            }
        }
        let mut weight = 0f32;
        for i in 0..4 {
            for a in 0..3 {
                pulls[i][a] -= 0.25 * sum[a];
            }
            let g = pulls[i];
            weight += p[i][3][l] * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
        }
        let s = sane(k[l] * value / weight);
        for i in 0..4 {
            for a in 0..3 {
                p[i][a][l] -= s * p[i][3][l] * pulls[i][a];
            }
        }
    }
}

/// Equation (10) on eight elements.
#[inline(always)]
fn inflate(p: &mut [Corner; 4], rest: &Lane, k: &Lane) {
    for l in 0..LANES {
        let [a, b, c] = [1, 2, 3].map(|i| [0, 1, 2].map(|x| p[i][x][l] - p[0][x][l]));
        let cross = |u: [f32; 3], v: [f32; 3]| {
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            [n[0] * (1.0 / 6.0), n[1] * (1.0 / 6.0), n[2] * (1.0 / 6.0)]
        };
        let (g1, g2, g3) = (cross(b, c), cross(c, a), cross(a, b));
        let g0 = [0, 1, 2].map(|x| -((g1[x] + g2[x]) + g3[x]));
        let value = (g3[0] * c[0] + g3[1] * c[1] + g3[2] * c[2]) - rest[l];
        let g = [g0, g1, g2, g3];
        let mut weight = 0f32;
        for i in 0..4 {
            weight += p[i][3][l] * (g[i][0] * g[i][0] + g[i][1] * g[i][1] + g[i][2] * g[i][2]);
        }
        let s = sane(k[l] * value / weight);
        for i in 0..4 {
            for x in 0..3 {
                p[i][x][l] -= s * p[i][3][l] * g[i][x];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::constraints::{hetero, stretch, volume};
    use super::super::project;
    use super::*;
    use crate::model::tests::block;
    use crate::vec3::{add, norm, scale, sub, xyz};

    fn shaken() -> (monro_geometry::TetMesh, Vec<[f32; 4]>, Vec<[f32; 4]>) {
        let mesh = block([4, 3, 3], 3.0);
        let rest: Vec<[f32; 4]> = mesh
            .vertices
            .iter()
            .enumerate()
            .map(|(i, v)| [v.x as f32, v.y as f32, v.z as f32, if i % 7 == 0 { 0.0 } else { 1.0 + i as f32 * 0.1 }])
            .collect();
        let noise = |i: usize, a: usize| ((i * 7919 + a * 104_729) % 1000) as f32 / 1000.0 - 0.5;
        let now =
            rest.iter().enumerate().map(|(i, p)| [p[0] + noise(i, 0), p[1] + noise(i, 1), p[2] + noise(i, 2), p[3]]);
        let now = now.collect();
        (mesh, rest, now)
    }

    #[test]
    fn groups_share_no_vertex_and_leave_nothing_out() {
        let (mesh, ..) = shaken();
        let groups = groups(&mesh.tets);
        let mut seen: Vec<u32> = groups.concat();
        seen.sort_unstable();
        assert_eq!(seen, (0..mesh.tets.len() as u32).collect::<Vec<_>>());
        for g in &groups {
            let mut nodes: Vec<u32> = g.iter().flat_map(|&t| mesh.tets[t as usize]).collect();
            let all = nodes.len();
            nodes.sort_unstable();
            nodes.dedup();
            assert_eq!(nodes.len(), all);
        }
    }

    #[test]
    fn eight_edges_at_once_do_what_the_plain_constraint_does() {
        let (mesh, rest, mut fast) = shaken();
        let nodes = mesh.edges();
        let at = |p: &[[f32; 4]], e: [u32; 2]| e.map(|v| xyz(p[v as usize]));
        let lengths: Vec<f32> = nodes.iter().map(|&e| stretch(at(&rest, e), 0.0).expect("apart").0).collect();
        let edges = Edges::new(&nodes, &lengths);
        let stiffness = vec![0.3; nodes.len()];
        let mut plain = fast.clone();
        edges.project(&mut fast, &stiffness);
        for b in &edges.0 {
            for &e in &b.source[..b.count] {
                let (value, g) = stretch(at(&plain, nodes[e as usize]), lengths[e as usize]).expect("apart");
                project(&mut plain, nodes[e as usize], value, g, 0.3);
            }
        }
        close(&fast, &plain);
    }

    #[test]
    fn eight_elements_at_once_do_what_the_plain_constraints_do() {
        let (mesh, rest, mut fast) = shaken();
        let at = |p: &[[f32; 4]], t: [u32; 4]| t.map(|v| xyz(p[v as usize]));
        let springs: Vec<[f32; 4]> = mesh
            .tets
            .iter()
            .map(|&t| {
                let p = at(&rest, t);
                let q = scale(add(add(p[0], p[1]), add(p[2], p[3])), 0.25);
                p.map(|v| norm(sub(v, q)))
            })
            .collect();
        let volumes: Vec<f32> = mesh.tets.iter().map(|&t| volume(at(&rest, t), 0.0).0).collect();
        let tets = Tets::new(&mesh.tets, &springs, &volumes);
        let (ks, kv) = (vec![0.2; volumes.len()], vec![0.6; volumes.len()]);
        let mut plain = fast.clone();
        tets.project(&mut fast, &ks, &kv);
        for b in &tets.0 {
            for &t in &b.source[..b.count] {
                let nodes = mesh.tets[t as usize];
                let (value, g) = hetero(at(&plain, nodes), springs[t as usize], [1.0; 4]);
                project(&mut plain, nodes, value, g, 0.2);
                let (value, g) = volume(at(&plain, nodes), volumes[t as usize]);
                project(&mut plain, nodes, value, g, 0.6);
            }
        }
        close(&fast, &plain);
    }

    fn close(a: &[[f32; 4]], b: &[[f32; 4]]) {
        for (p, q) in a.iter().zip(b) {
            assert!((0..3).all(|k| (p[k] - q[k]).abs() < 1e-4), "{p:?} {q:?}");
        }
    }
}
