//! Drawing points of the lattice into thin parts: cuts follow a part only where a point lies in it.

use super::adjacency::Incidence;
use super::fields::LabelFields;
use super::quality::quality;
use super::thickness::Thin;
use monro_geometry::bounds;
use monro_geometry::d3::{D3, distance, volume6};

/// A middle is reached where a point in its part is within this many cells of the fields.
const REACHED: f64 = 0.75;
/// Drawing may not leave an element worse than this.
const WORST: f64 = 0.2;

/// Moves points of a lattice onto middles of thin parts that no corner of the element around them reaches. Returns which
/// points were moved: they should stay there.
pub(super) fn draw(points: &mut [D3], tets: &[[u32; 4]], thin: &Thin, fields: &LabelFields) -> Vec<bool> {
    let mut stays = vec![false; points.len()];
    let held = held(points, tets, thin);
    if held.is_empty() {
        return stays;
    }
    let around = Incidence::new(tets, points.len());
    for (l, p, t) in held {
        let mut corners = tets[t as usize];
        let off = |v: &u32, points: &[D3]| distance(points[*v as usize], p);
        corners.sort_by(|a, b| off(a, points).total_cmp(&off(b, points)));
        let part = fields.parts.get(usize::from(l));
        let reaches = |v: &u32, points: &[D3]| {
            off(v, points) < REACHED * fields.step && part.is_none_or(|part| part.at(points[*v as usize]) >= 0.5)
        };
        if corners.iter().any(|v| reaches(v, points)) {
            continue;
        }
        for v in corners.into_iter().filter(|&v| !stays[v as usize]) {
            let from = std::mem::replace(&mut points[v as usize], p);
            let good = |&t: &u32| quality(tets[t as usize].map(|v| points[v as usize])) > WORST;
            if around.of(v as usize).iter().all(good) {
                stays[v as usize] = true;
                break;
            }
            points[v as usize] = from;
        }
    }
    stays
}

/// The middles with their labels and the first element that holds each.
fn held(points: &[D3], tets: &[[u32; 4]], thin: &Thin) -> Vec<(u8, D3, u32)> {
    let mut found = Vec::new();
    for (t, tet) in (0u32..).zip(tets) {
        let c = tet.map(|v| points[v as usize]);
        let [low, high]: [D3; 2] = bounds(c).unwrap_or_default();
        let holds = |p: D3| {
            (0..4).all(|i| {
                let mut d = c;
                d[i] = p;
                volume6(d) >= 0.0
            })
        };
        found.extend(thin.within(low, high).filter(|&(_, p)| holds(p)).map(|(l, p)| (l, p, t)));
    }
    let key = |m: &(u8, D3, u32)| (m.1.map(f64::to_bits), m.0, m.2);
    found.sort_unstable_by_key(key);
    found.dedup_by_key(|m| (m.1.map(f64::to_bits), m.0));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Grid, Volume};

    #[test]
    fn a_rod_that_runs_between_the_points_of_a_lattice_gets_points_of_its_own() {
        // A rod along x, two voxels thick, half way between the points of a lattice of 4 mm; and a thick block beside it.
        let grid = Grid::axis_aligned([40, 40, 40], [1.0; 3], [-19.5; 3]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            let [x, y, z] = grid.centre(i, j, k).to_array();
            let rod = x > -12.0 && x < 12.0 && y.abs() < 1.0 && z.abs() < 1.0;
            if rod || (x < -2.0 && y.abs() < 12.0 && z.abs() < 12.0) { 2u16 } else { 1 }
        });
        let labels = Volume::new(grid, data.collect()).expect("count");
        let fields = LabelFields::new(&labels, &[1, 2]).expect("fields");
        let fine = fields.labels.iter().position(|&l| l == 2).expect("there");
        let thin = Thin::new(&fields, &[fine], 4.0);
        let tree = super::super::octree::Octree::new(3, |_, edge| edge > 2);
        let lattice = super::super::lattice::lattice(&tree);
        // Cells of two units: corners at multiples of 4 mm from -17, centres between.
        let mut points: Vec<D3> = lattice.points.iter().map(|p| p.map(|x| 2.0 * f64::from(x) - 17.0)).collect();
        let before = points.clone();
        let stays = draw(&mut points, &lattice.tets, &thin, &fields);
        let in_rod = |p: &&D3| p[0] > -1.0 && p[0] < 12.0 && p[1].abs() < 1.0 && p[2].abs() < 1.0;
        assert_eq!(before.iter().filter(in_rod).count(), 0);
        assert!(points.iter().filter(in_rod).count() >= 3);
        for (v, stays) in stays.into_iter().enumerate() {
            assert_eq!(stays, points[v] != before[v]);
            assert!(!stays || fields.parts[fine].at(points[v]) >= 0.5, "{:?}", points[v]);
        }
        assert!(lattice.tets.iter().all(|t| quality(t.map(|v| points[v as usize])) > WORST));
    }
}
