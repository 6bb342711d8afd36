use super::*;
use proptest::prelude::*;

/// A cube of `n`^3 unit cells, six tetrahedra each (Kuhn).
pub(crate) fn block(n: usize) -> TetMesh {
    let at = |i: usize, j: usize, k: usize| ((k * (n + 1) + j) * (n + 1) + i) as u32;
    let mut mesh = TetMesh::default();
    for k in 0..=n {
        for j in 0..=n {
            for i in 0..=n {
                mesh.vertices.push(Point::new(i as f64, j as f64, k as f64));
            }
        }
    }
    for cell in 0..n * n * n {
        let base = [cell % n, cell / n % n, cell / (n * n)];
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut corner = base;
            let mut tet = [at(base[0], base[1], base[2]); 4];
            for (step, &axis) in order.iter().enumerate() {
                corner[axis] += 1;
                tet[step + 1] = at(corner[0], corner[1], corner[2]);
            }
            if crate::tet_signed_volume(tet.map(|v| mesh.vertices[v as usize])) < 0.0 {
                tet.swap(2, 3);
            }
            mesh.tets.push(tet);
            mesh.labels.push(4);
        }
    }
    mesh
}

fn nodes(mesh: &TetMesh, map: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f32; 4]> {
    mesh.vertices.iter().map(|p| lanes(map(p.to_array()))).collect()
}

fn lanes(p: [f64; 3]) -> [f32; 4] {
    [p[0] as f32, p[1] as f32, p[2] as f32, 0.0]
}

fn distance(a: [f32; 4], b: [f32; 4]) -> f32 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt()
}

/// A quarter turn about the vertical axis over the height of the block, 4.
fn twist(p: [f64; 3]) -> [f64; 3] {
    let (s, c) = (p[2] / 4.0 * std::f64::consts::FRAC_PI_2).sin_cos();
    let (x, y) = (p[0] - 2.0, p[1] - 2.0);
    [2.0 + c * x - s * y, 2.0 + s * x + c * y, p[2]]
}

proptest! {
    #[test]
    fn affine_maps_are_followed_exactly_inside_and_near(p in proptest::array::uniform3(-0.2..4.2f64), m in proptest::array::uniform9(-1.0..1.0f64)) {
        let mesh = block(4);
        let e = Embedding::new(&mesh, &[Point::from_array(p)]).expect("bound");
        let map = |p: [f64; 3]| core::array::from_fn(|r| p[r] + (0..3).map(|c| m[3 * r + c] * p[c]).sum::<f64>() + 7.0);
        let mut out = [[0.0; 4]];
        e.apply(&nodes(&mesh, map), &mut out);
        prop_assert!(distance(out[0], lanes(map(p))) < 1e-4);
    }

    #[test]
    fn rigid_motions_are_followed_exactly_from_far_away(p in proptest::array::uniform3(-9.0..13.0f64), angle in -3.0..3.0f64) {
        let mesh = block(4);
        let e = Embedding::new(&mesh, &[Point::from_array(p)]).expect("bound");
        let map = |p: [f64; 3]| [angle.cos() * p[0] - angle.sin() * p[1] + 3.0, angle.sin() * p[0] + angle.cos() * p[1], p[2] - 1.0];
        let mut out = [[0.0; 4]];
        e.apply(&nodes(&mesh, map), &mut out);
        prop_assert!(distance(out[0], lanes(map(p))) < 1e-4);
    }
}

/// A dense surface around the block, `gap` outside of it: rings of points and the distances along them.
fn shell(gap: f64) -> Vec<Point<Patient>> {
    let r = 2.0 * std::f64::consts::SQRT_2 + gap;
    let mut points = Vec::new();
    for k in 0..=80 {
        for i in 0..200 {
            let a = f64::from(i) / 200.0 * std::f64::consts::TAU;
            points.push(Point::new(2.0 + r * a.cos(), 2.0 + r * a.sin(), f64::from(k) * 0.05));
        }
    }
    points
}

#[test]
fn a_strong_twist_throws_no_spikes() {
    let mesh = block(4);
    let twisted = nodes(&mesh, twist);
    for gap in [0.01, 0.3, 1.0, 3.0] {
        let points = shell(gap);
        let e = Embedding::new(&mesh, &points).expect("bound");
        assert!(e.outside() > 0 && e.max_extrapolation() > gap);
        let mut out = vec![[0.0; 4]; points.len()];
        e.apply(&twisted, &mut out);
        for (p, o) in points.iter().zip(&out) {
            // The twist shears the faces by up to r dphi/dz = 1, i.e. 45 degrees, and a frame on them turns as much: an
            // offset d then ends 2 sin(45 / 2) d = 0.77 d away at most. The chords of unit cells add 0.4 mm.
            let exact = lanes(twist(p.to_array()));
            let d = gap + 2.0 * (std::f64::consts::SQRT_2 - 1.0);
            assert!(f64::from(distance(*o, exact)) < 0.77 * d + 0.4, "gap {gap} {p:?}: {o:?} for {exact:?}");
        }
    }
}

#[test]
fn chunks_give_the_same_bits_as_the_whole() {
    let mesh = block(4);
    let points = shell(1.0);
    let e = Embedding::new(&mesh, &points).expect("bound");
    let n = nodes(&mesh, twist);
    let (mut whole, mut parts) = (vec![[0.0; 4]; points.len()], vec![[0.0; 4]; points.len()]);
    e.apply(&n, &mut whole);
    for (c, chunk) in parts.chunks_mut(777).enumerate() {
        e.apply_from(c * 777, &n, chunk);
    }
    assert_eq!(whole, parts);
}

#[test]
fn chunks_bound_by_several_threads_in_any_order_give_the_same_bits() {
    let mesh = block(4);
    let points: Vec<_> = [0.0, 0.3, 2.0].into_iter().flat_map(shell).collect();
    let locator = TetLocator::new(&mesh).expect("valid");
    let binder = Binder::new(&locator, &mesh, &points).expect("finite");
    assert!(binder.chunks() > 4);
    let parts: Vec<Vec<BoundChunk>> = std::thread::scope(|scope| {
        let run = |turn: usize| {
            let binder = &binder;
            let mine = (0..binder.chunks()).rev().filter(move |c| c % 3 == turn);
            scope.spawn(move || mine.map(|c| binder.bind(c).expect("finite")).collect())
        };
        let threads: Vec<_> = (0..3).map(run).collect();
        threads.into_iter().map(|t| t.join().expect("no panic")).collect()
    });
    let whole = Embedding::new(&mesh, &points).expect("bound");
    assert_eq!(binder.join(parts.into_iter().flatten().collect()), whole);
    assert!(whole.riders.len() > 100 && whole.outside < points.len());
}

#[test]
#[should_panic(expected = "each chunk once")]
fn a_missing_chunk_is_noticed() {
    let (mesh, points) = (block(1), shell(0.1));
    let locator = TetLocator::new(&mesh).expect("valid");
    let binder = Binder::new(&locator, &mesh, &points).expect("finite");
    binder.join(vec![binder.bind(0).expect("finite")]);
}

#[test]
fn a_squeezed_mesh_gives_finite_points() {
    let mesh = block(2);
    let e = Embedding::new(&mesh, &[Point::new(9.0, 1.0, 1.0), Point::new(1.0, 1.0, 1.0)]).expect("bound");
    let mut out = [[f32::NAN; 4]; 2];
    e.apply(&nodes(&mesh, |_| [1.0, 2.0, 3.0]), &mut out);
    assert!(out.iter().flatten().all(|x| x.is_finite()));
    assert!((out[0][0] - 1.0).abs() < 1e-5);
}

#[test]
fn bad_input_is_named() {
    let nowhere = Point::new(f64::NAN, 0.0, 0.0);
    assert_eq!(Embedding::new(&block(1), &[Point::ORIGIN, nowhere]), Err(EmbeddingError::NotFinite(1)));
    assert_eq!(Embedding::new(&TetMesh::default(), &[nowhere]), Err(EmbeddingError::NoElements { points: 1 }));
}

#[test]
fn bindings_read_out_move_points_as_the_embedding_does() {
    let mesh = block(3);
    let points = [[0.3, 1.7, 2.2], [2.9, 0.1, 1.5], [1.0, 1.0, 1.0]].map(Point::from_array);
    let e = Embedding::new(&mesh, &points).expect("bound");
    let n = nodes(&mesh, twist);
    let mut out = [[0.0; 4]; 3];
    e.apply(&n, &mut out);
    for (i, o) in out.iter().enumerate() {
        let (nodes, weights) = e.binding(i);
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        for (a, x) in o.iter().enumerate().take(3) {
            let sum: f32 = nodes.iter().zip(weights).map(|(&v, w)| w * n[v as usize][a]).sum();
            assert!((sum - x).abs() < 1e-5);
        }
    }
}
