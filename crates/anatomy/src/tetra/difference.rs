//! Where two surfaces of about the same shape differ in topology.
//!
//! By Gauss and Bonnet the angles missing around the points of a closed surface sum to 2 pi times its Euler number, so a
//! handle more is -4 pi in one place, where surfaces that only differ in roughness have the same sum.

use monro_geometry::{Bvh, Patient, Point, TriangleMesh};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Size of the places that are told apart, mm: more than the handles that a mesh loses, less than a ventricle.
const CELL: f64 = 6.0;

/// A surface and how many pieces it has.
pub(super) type Pieces<'a> = (&'a TriangleMesh, usize);

/// A vertex near the difference: where a piece of the surface that has more is nearest to another one that is one with it on
/// the other surface (or that it has come off from), else where most angles are missing on
/// one surface and not on the other. The origin when both are empty. `unit`: what stands for a millimetre.
pub(super) fn place((found, more): Pieces<'_>, (wanted, less): Pieces<'_>, unit: f64) -> [f64; 3] {
    if more != less {
        return if more > less { between_pieces(found, wanted) } else { between_pieces(wanted, found) };
    }
    let mut cells = BTreeMap::new();
    spread(found, 1.0, CELL * unit, &mut cells);
    spread(wanted, -1.0, CELL * unit, &mut cells);
    let most = cells.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let centre = Point::from_array(most.map_or([0.0; 3], |(cell, _)| cell.map(|c| f64::from(c) * CELL * unit)));
    let vertices = found.vertices.iter().chain(&wanted.vertices);
    let nearest = vertices.min_by(|a, b| a.distance(centre).total_cmp(&b.distance(centre)));
    nearest.unwrap_or(&centre).to_array()
}

/// The point of a piece of `more` that is nearest to the others which lie at the same piece of `less`: of the smallest such, or
/// a point of the smallest where there is none.
fn between_pieces(more: &TriangleMesh, less: &TriangleMesh) -> [f64; 3] {
    let (piece, count) = more.components();
    let mut first = vec![None; count];
    let mut size = vec![0usize; count];
    for (t, &p) in piece.iter().enumerate() {
        first[p as usize].get_or_insert(t);
        size[p as usize] += 1;
    }
    let (of, at) = (less.components().0, Bvh::new(less));
    let corner = |t: usize| more.corners(t)[0];
    let home = |p: usize| at.nearest(corner(first[p]?)).map(|n| of[n.triangle]);
    let homes: Vec<Option<u32>> = (0..count).map(home).collect();
    let shared = |&p: &usize| (0..count).any(|q| q != p && homes[q] == homes[p]);
    let smallest = |pieces: &mut dyn Iterator<Item = usize>| pieces.min_by_key(|&p| size[p]);
    // Where the other surface has nothing at all, none shares its place with another.
    let least = smallest(&mut (0..count).filter(shared)).or_else(|| smallest(&mut (0..count)));
    let Some(least) = least else { return [0.0; 3] };
    let beside = |t: &usize| piece[*t] as usize != least && homes[piece[*t] as usize] == homes[least];
    let others = Bvh::new(&TriangleMesh {
        vertices: more.vertices.clone(),
        triangles: (0..piece.len()).filter(beside).map(|t| more.triangles[t]).collect(),
    });
    let own = (0..piece.len()).filter(|&t| piece[t] as usize == least).flat_map(|t| more.corners(t));
    let far = |p: &Point<Patient>| others.nearest(*p).map_or(f64::INFINITY, |n| n.distance);
    own.min_by(|a, b| far(a).total_cmp(&far(b))).map_or([0.0; 3], |p| p.to_array())
}

/// Adds what is missing to a full turn around each point, shared out among the eight cells around it so that nothing jumps
/// where cells meet.
fn spread(surface: &TriangleMesh, sign: f64, edge: f64, cells: &mut BTreeMap<[i32; 3], f64>) {
    let (mut sums, mut base) = ([0.0; 8], [0; 3]);
    for (p, missing) in surface.vertices.iter().zip(missing_angles(surface)) {
        let at = p.to_array().map(|x| x / edge);
        let low = at.map(|x| x.floor() as i32);
        // Neighbours in the list are mostly neighbours in space: a cell is looked up once for many.
        if low != base {
            add_around(std::mem::replace(&mut base, low), &std::mem::take(&mut sums), cells);
        }
        for (corner, sum) in sums.iter_mut().enumerate() {
            let share =
                |a: usize| if corner >> a & 1 == 1 { at[a] - at[a].floor() } else { 1.0 - (at[a] - at[a].floor()) };
            *sum += sign * missing * share(0) * share(1) * share(2);
        }
    }
    add_around(base, &sums, cells);
}

/// Adds sums to the eight cells from `low` on, the first axis fastest.
fn add_around(low: [i32; 3], sums: &[f64; 8], cells: &mut BTreeMap<[i32; 3], f64>) {
    for (corner, sum) in sums.iter().enumerate() {
        let cell = [0, 1, 2].map(|a| low[a] + (corner >> a & 1) as i32);
        *cells.entry(cell).or_insert(0.0) += sum;
    }
}

/// A full turn less the angles of the triangles around each point; 0 for a point without triangles.
fn missing_angles(surface: &TriangleMesh) -> Vec<f64> {
    let mut missing = vec![0.0; surface.vertices.len()];
    surface.triangles.iter().flatten().for_each(|&v| missing[v as usize] = TAU);
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let corners = surface.corners(t);
        for (i, &v) in triangle.iter().enumerate() {
            missing[v as usize] -= angle(corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]);
        }
    }
    missing
}

fn angle(at: Point<Patient>, b: Point<Patient>, c: Point<Patient>) -> f64 {
    let (u, v) = (b - at, c - at);
    u.cross(v).norm().atan2(u.dot(v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::isosurface;
    use monro_geometry::{Grid, Volume};

    fn surface(value: impl Fn([f64; 3]) -> f64) -> TriangleMesh {
        let grid = Grid::axis_aligned([70; 3], [1.0; 3], [-34.3, -34.6, -34.4]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            value(grid.centre(i, j, k).to_array()) as f32
        });
        isosurface(&Volume::new(grid, data.collect()).expect("count"), 0.0)
    }

    fn ball(p: [f64; 3], centre: [f64; 3], radius: f64) -> f64 {
        radius - (0..3).map(|a| (p[a] - centre[a]).powi(2)).sum::<f64>().sqrt()
    }

    fn off(found: [f64; 3], wanted: [f64; 3]) -> f64 {
        (0..3).map(|a| (found[a] - wanted[a]).powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn the_angles_missing_are_two_pi_times_the_euler_number() {
        let s = surface(|p| ball(p, [0.0; 3], 20.0));
        assert!((missing_angles(&s).iter().sum::<f64>() - 2.0 * TAU).abs() < 1e-9);
    }

    #[test]
    fn a_handle_is_found_on_a_rough_surface() {
        // A tunnel of 3 mm through the rim of a wavy ball.
        let rough = |p: [f64; 3], fine: f64| {
            ball(p, [0.0; 3], 25.0) + fine * ((p[0] * 1.3).sin() + (p[1] * 1.1).sin() + (p[2] * 1.7).sin())
        };
        let tunnel = |p: [f64; 3]| ((p[0] - 21.0).powi(2) + p[1].powi(2)).sqrt() - 1.5;
        let with = surface(|p| rough(p, 0.3).min(tunnel(p)));
        let without = surface(|p| rough(p, 0.1));
        assert_eq!((with.topology().euler(), without.topology().euler()), (0, 2));
        // The tunnel ends where the ball is 13.6 mm high.
        let found = place((&with, 1), (&without, 1), 1.0);
        assert!(off([found[0], found[1], 0.0], [21.0, 0.0, 0.0]) < 8.0 && found[2].abs() < 18.0, "{found:?}");
    }

    /// The far end of one of them was named.
    #[test]
    fn two_pieces_grown_together_are_found_where_they_met() {
        let bars = |p: [f64; 3]| {
            let side = |low: f64| (p[0] - low).min(low + 14.0 - p[0]).min(5.0 - p[1].abs()).min(5.0 - p[2].abs());
            side(-15.0).max(side(1.0))
        };
        let (two, apart) = (surface(bars), |p: [f64; 3]| ball(p, [24.0, 20.0, 20.0], 4.0));
        let one = surface(|p| (p[0] + 15.0).min(15.0 - p[0]).min(5.0 - p[1].abs()).min(5.0 - p[2].abs()).max(apart(p)));
        let three = surface(|p| bars(p).max(apart(p)));
        assert_eq!([&two, &three, &one].map(|s| s.components().1), [2, 3, 2]);
        for found in [place((&one, 2), (&three, 3), 1.0), place((&three, 3), (&one, 2), 1.0)] {
            assert!(found[0].abs() < 2.0 && found[1].abs() < 6.0, "{found:?}");
        }
    }

    #[test]
    fn a_piece_more_is_found() {
        let two = surface(|p| ball(p, [0.0; 3], 15.0).max(ball(p, [22.0, 5.0, -3.0], 4.0)));
        let one = surface(|p| ball(p, [0.0; 3], 15.0));
        assert!(off(place((&two, 2), (&one, 1), 1.0), [22.0, 5.0, -3.0]) < 5.0);
        assert!(off(place((&one, 1), (&two, 2), 1.0), [22.0, 5.0, -3.0]) < 5.0);
    }
}
