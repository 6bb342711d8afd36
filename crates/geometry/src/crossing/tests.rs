use super::finder::MOST;
use super::*;
use crate::triangles::tests::octahedron;
use proptest::prelude::*;
use std::collections::BTreeSet;

type Corners = [[i64; 3]; 3];

fn orient([a, b, c]: Corners, d: [i64; 3]) -> i64 {
    let [u, v, w] = [b, c, d].map(|p| [0, 1, 2].map(|k| p[k] - a[k]));
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    (0..3).map(|k| cross[k] * w[k]).sum::<i64>().signum()
}

/// Whether the line from `p` to `q` passes through the inside of a triangle, by whole numbers; `None` where it meets the rim,
/// or an end lies in the plane.
fn passes(t: Corners, p: [i64; 3], q: [i64; 3]) -> Option<bool> {
    let (above, below) = (orient(t, p), orient(t, q));
    let around = [0, 1, 2].map(|i| orient([p, q, t[i]], t[(i + 1) % 3]));
    let all = around.iter().chain([&above, &below]).all(|s| *s != 0);
    all.then_some(above != below && around[0] == around[1] && around[1] == around[2])
}

/// Whether two triangles in general position cross: an edge of one passes through the other. Edges at the corner that both
/// share end there, so only those opposite to it are asked.
fn exact(a: Corners, b: Corners) -> Option<bool> {
    let shared: Vec<[i64; 3]> = a.into_iter().filter(|p| b.contains(p)).collect();
    let mut found = false;
    for (t, o) in [(a, b), (b, a)] {
        for i in 0..3 {
            let (p, q) = (o[i], o[(i + 1) % 3]);
            if shared.contains(&p) || shared.contains(&q) {
                continue;
            }
            found |= passes(t, p, q)?;
        }
    }
    (shared.len() < 2).then_some(found)
}

fn points(t: Corners) -> [Point<Patient>; 3] {
    t.map(|p| Point::from_array(p.map(|c| c as f64)))
}

fn corner() -> impl Strategy<Value = [i64; 3]> {
    proptest::array::uniform3(-8..8i64)
}

fn triangle(corners: [[f64; 3]; 3]) -> [Point<Patient>; 3] {
    corners.map(Point::from_array)
}

/// A sphere of `n` by `2 n` patches.
fn sphere(n: u32, radius: f64, centre: [f64; 3]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let turn = std::f64::consts::PI / f64::from(n);
    for i in 1..n {
        for j in 0..2 * n {
            let (u, v) = (f64::from(i) * turn, f64::from(j) * turn);
            let at = [u.sin() * v.cos(), u.sin() * v.sin(), u.cos()];
            mesh.vertices.push(Point::from_array([0, 1, 2].map(|k| centre[k] + radius * at[k])));
        }
    }
    let (m, poles) = (2 * n, mesh.vertices.len() as u32);
    mesh.vertices.extend([1.0, -1.0].map(|z| Point::new(centre[0], centre[1], centre[2] + radius * z)));
    for j in 0..m {
        let at = |i: u32, j: u32| (i - 1) * m + j % m;
        mesh.triangles.push([poles, at(1, j), at(1, j + 1)]);
        mesh.triangles.push([poles + 1, at(n - 1, j + 1), at(n - 1, j)]);
        for i in 1..n - 1 {
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    mesh
}

proptest! {
    #[test]
    fn whole_numbers_agree(a in proptest::array::uniform3(corner()), b in proptest::array::uniform3(corner())) {
        if let Some(cross) = exact(a, b) {
            prop_assert_eq!(triangles_cross(&points(a), &points(b)), cross);
        }
    }

    #[test]
    fn whole_numbers_agree_on_triangles_with_a_common_corner(
        a in proptest::array::uniform3(corner()), b in proptest::array::uniform2(corner()), at in 0..3usize,
    ) {
        let b = [b[0], a[at], b[1]];
        if let Some(cross) = exact(a, b) {
            prop_assert_eq!(triangles_cross(&points(a), &points(b)), cross);
        }
    }

    #[test]
    fn the_tree_finds_what_trying_all_pairs_does(
        corners in prop::collection::vec(proptest::array::uniform3(proptest::array::uniform3(-3.0..3.0f64)), 0..60),
        wild in prop::collection::vec((0..180usize, prop::sample::select(vec![f64::NAN, f64::INFINITY, 1e300, 0.0])), 0..6),
    ) {
        let mut vertices: Vec<Point<Patient>> = corners.iter().flatten().map(|&p| Point::from_array(p)).collect();
        for (at, x) in wild {
            vertices.get_mut(at).into_iter().for_each(|p| p.x = x);
        }
        let triangles = (0..corners.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let mesh = TriangleMesh { vertices, triangles };
        let n = mesh.triangles.len();
        let all = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i as u32, j as u32]));
        let cross = |p: &[u32; 2]| triangles_cross(&mesh.corners(p[0] as usize), &mesh.corners(p[1] as usize));
        let found = mesh.crossings();
        prop_assert_eq!(&found.pairs, &all.filter(cross).collect::<Vec<_>>());
        for pair in found.pairs {
            let at = mesh.crossing_place(pair);
            for t in pair.map(|t| mesh.corners(t as usize)) {
                let off = at.distance(crate::nearest_on_triangle(at, t));
                prop_assert!(off < 1e-6 || off < 1e-6 * t[0].distance(t[1]), "{} off", off);
            }
        }
    }
}

#[test]
fn neighbours_cross_only_where_they_are_folded_onto_each_other() {
    let flat = triangle([[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
    let over = |p: [f64; 3]| triangle([[1., 0., 0.], [0., 0., 0.], p]);
    for (third, folded) in [
        ([0.3, -1.0, 0.0], false),
        ([0.3, -1.0, 1e-12], false),
        ([0.3, 0.5, 0.1], false),
        ([0.3, 0.5, 1e-3], false),
        ([0.3, 0.5, 0.0], true),
        ([0.3, 0.5, 1e-12], true),
    ] {
        assert_eq!(triangles_cross(&flat, &over(third)), folded, "{third:?}");
    }
    assert!(triangles_cross(&flat, &flat));
}

#[test]
fn a_common_corner_does_not_hide_a_crossing() {
    let flat = triangle([[0., 0., 0.], [4., 0., 0.], [0., 4., 0.]]);
    let fin = |z: f64| triangle([[0., 0., 0.], [1., 1., z], [1., 1., 1.]]);
    assert!(triangles_cross(&flat, &fin(-1.0)));
    assert!(!triangles_cross(&flat, &fin(0.0)), "an edge lies on it");
    assert!(!triangles_cross(&flat, &fin(0.5)));
    assert!(!triangles_cross(&flat, &triangle([[0., 0., 0.], [-1., -1., -1.], [-1., -1., 1.]])));
}

#[test]
fn triangles_that_only_touch_do_not_cross() {
    let flat = triangle([[0., 0., 0.], [4., 0., 0.], [0., 4., 0.]]);
    assert!(!triangles_cross(&flat, &triangle([[1., 1., 0.], [1., 1., 1.], [2., 1., 1.]])), "a corner");
    assert!(!triangles_cross(&flat, &triangle([[1., 0., 0.], [3., 0., 0.], [2., -1., 0.]])), "a part of an edge");
    assert!(triangles_cross(&flat, &triangle([[1., 1., -1e-3], [1., 1., 1.], [2., 1., 1.]])), "a corner goes through");
}

#[test]
fn triangles_without_an_inside_cross_nothing() {
    let flat = triangle([[0., 0., 0.], [4., 0., 0.], [0., 4., 0.]]);
    let needle = |c: [f64; 3]| triangle([[1., 1., -1.], [1., 1., 1.], c]);
    assert!(triangles_cross(&flat, &needle([2., 1., 0.])));
    for c in [[1., 1., 0.], [1., 1., 1.], [f64::NAN, 1., 0.], [f64::INFINITY, 1., 0.]] {
        assert!(!triangles_cross(&flat, &needle(c)) && !triangles_cross(&needle(c), &flat), "{c:?}");
    }
}

proptest! {
    /// The quick tests of the search against all pairs by the full test, before and after some triangles have moved.
    #[test]
    fn no_pair_is_lost_by_what_makes_the_search_quick(
        soup in proptest::collection::vec(proptest::array::uniform3(0..60u32), 30..60),
        places in proptest::collection::vec(corner(), 60),
        moved in proptest::collection::vec((0..60usize, corner()), 1..6),
    ) {
        let at = |c: [i64; 3]| Point::from_array(c.map(|x| x as f64 * 1.5));
        let mut mesh = TriangleMesh { vertices: places.into_iter().map(at).collect(), triangles: soup };
        let all = |mesh: &TriangleMesh, any: &dyn Fn(u32) -> bool| {
            let n = mesh.triangles.len() as u32;
            let pairs = (0..n).flat_map(|s| (s + 1..n).map(move |t| [s, t])).filter(|p| p.iter().any(|&t| any(t)));
            let cross = |p: &[u32; 2]| triangles_cross(&mesh.corners(p[0] as usize), &mesh.corners(p[1] as usize));
            pairs.filter(cross).collect::<Vec<_>>()
        };
        let finder = CrossingFinder::new(&mesh);
        prop_assert_eq!(finder.all().pairs, all(&mesh, &|_| true));
        moved.iter().for_each(|&(v, place)| mesh.vertices[v] = at(place));
        let touched = |t: u32| mesh.triangles[t as usize].iter().any(|&v| moved.iter().any(|m| m.0 == v as usize));
        let which: Vec<u32> = (0..mesh.triangles.len() as u32).filter(|&t| touched(t)).collect();
        prop_assert_eq!(finder.among(&mesh, &which).pairs, all(&mesh, &touched));
    }
}

#[test]
fn a_clean_surface_does_not_cross_itself_wherever_it_is_and_however_large() {
    for (radius, centre) in [
        (50.0, [0.0; 3]),
        (0.05, [0.0; 3]),
        (5e4, [0.0; 3]),
        (50.0, [1e6, -2e6, 3e6]),
        (50.0, [1e9, 1e9, -1e9]),
        (0.05, [1e6, 0.0, 0.0]),
    ] {
        assert_eq!(sphere(60, radius, centre).crossings(), Crossings::default(), "{radius} mm at {centre:?}");
    }
    // Two spheres that only come near.
    let mut two = sphere(40, 10.0, [0.0; 3]);
    two.append(&sphere(40, 10.0, [20.001, 0.0, 0.0]));
    assert!(two.crossings().pairs.is_empty());
    assert!(octahedron().crossings().pairs.is_empty());
}

#[test]
fn two_spheres_in_each_other_cross_along_their_circle() {
    let mut two = sphere(40, 10.0, [0.0; 3]);
    let first = two.triangles.len() as u32;
    two.append(&sphere(40, 10.0, [12.0, 0.3, 0.1]));
    let found = two.crossings();
    assert!(found.pairs.len() > 100 && found.pairs.iter().all(|p| p[0] < first && p[1] >= first), "{found:?}");
    for &pair in &found.pairs {
        let at = two.crossing_place(pair);
        assert!((at.x - 6.0).abs() < 0.6 && ((at.y * at.y + at.z * at.z).sqrt() - 8.0).abs() < 0.6, "{at:?}");
    }
    let touched: BTreeSet<u32> = found.pairs.iter().flatten().copied().collect();
    assert!(touched.len() > 80, "{}", touched.len());
}

/// Faces of boxes that slide along each other lie in common planes, and no edge passes through a face.
#[test]
fn boxes_that_overlap_along_an_axis_cross() {
    let cube = |x: f64| {
        let corner = |i: u32| Point::new(x + f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriangleMesh { vertices: (0..8).map(corner).collect(), triangles }
    };
    let crossing = |x: f64| {
        let mut two = cube(0.0);
        two.append(&cube(x));
        two.crossings().pairs.len()
    };
    assert_eq!([0.5, 1.5].map(|x| crossing(x) > 0), [true, false]);
    assert_eq!(cube(0.0).crossings().pairs.len(), 0);
    assert_eq!(crossing(1.0), 2, "two faces on each other");
}

/// A heap of the same triangle has half a billion pairs.
#[test]
fn a_heap_of_triangles_ends_the_search() {
    let vertices = triangle([[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]).to_vec();
    let heap = TriangleMesh { vertices, triangles: vec![[0, 1, 2]; 32_000] };
    let found = heap.crossings();
    assert!(found.cut_short && found.pairs.len() == MOST);
}

#[test]
#[ignore = "a measurement"]
fn time_of_a_surface_of_300_000_triangles() {
    let mesh = sphere(274, 80.0, [3.0, 4.0, 5.0]);
    let start = std::time::Instant::now();
    let found = mesh.crossings().pairs.len();
    println!("{} triangles, {found} pairs, {:?}", mesh.triangles.len(), start.elapsed());
}
