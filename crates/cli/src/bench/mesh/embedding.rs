//! The hybrid model: binding a fine surface to tetrahedra, moving it with its normals, and how exact that is.

use anyhow::Result;
use monro_anatomy::surface::{SurfaceOptions, decimate, label_surface};
use monro_geometry::{
    Binder, Embedding, Patient, Point, SurfaceNormals, TetLocator, TetMesh, TriangleMesh, Vector, Volume, bounds,
};
use monro_guidance::simulation::quantile;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::time::Instant;

/// Points of the surface that is bound, and of the one that is moved in each frame.
const BOUND: usize = 300_000;
const MOVED: usize = 100_000;
const FRAMES: usize = 400;
const BINDINGS: usize = 5;
/// Points that a thread takes at a time.
const CHUNK: usize = 8192;
/// The exact field: a turn about the vertical axis by this over the height of the mesh, radians.
const TWIST: f64 = std::f64::consts::FRAC_PI_2;

/// Binds the outer surface of the voxels in `keep` to a mesh of them and moves it: times on the present threads, and its error
/// against moving each point by the exact field.
pub(super) fn measure(tets: &TetMesh, labels: &Volume<u16>, keep: &[u16]) -> Result<Value> {
    let surface = label_surface(labels, |l| keep.contains(&l), &SurfaceOptions::default())?.mesh;
    let fine = with_points(&surface, BOUND);
    let mut bind = Vec::new();
    for _ in 0..BINDINGS {
        let begin = Instant::now();
        bound(tets, &fine.vertices)?;
        bind.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    let moved = with_points(&surface, MOVED);
    let mut live = Live::new(tets, &moved)?;
    let field = twist(tets);
    let nodes: Vec<[f32; 4]> = tets.vertices.iter().map(|&p| lanes(field(p))).collect();
    let frames: Vec<[f64; 2]> = (0..FRAMES).map(|_| live.frame(&nodes)).collect();
    let positions: Vec<f64> = frames.iter().map(|f| f[0]).collect();
    let both: Vec<f64> = frames.iter().map(|f| f[0] + f[1]).collect();
    Ok(json!({
        "bound_points": fine.vertices.len(), "bind_ms": quantile(&bind, 0.0), "bind_ms_median": quantile(&bind, 0.5),
        "moved_points": moved.vertices.len(), "threads": rayon::current_num_threads(),
        "frame_ms": quantile(&both, 0.0), "frame_ms_median": quantile(&both, 0.5),
        "positions_ms_median": quantile(&positions, 0.5),
        "outside": live.embedding.outside(), "farthest_outside_mm": live.embedding.max_extrapolation(),
        "twist": live.errors(&moved, &field),
    }))
}

/// Binds on the present threads.
fn bound(tets: &TetMesh, points: &[Point<Patient>]) -> Result<Embedding> {
    let locator = TetLocator::new(tets)?;
    let binder = Binder::new(&locator, tets, points)?;
    let chunks = (0..binder.chunks()).into_par_iter().map(|c| binder.bind(c)).collect::<Result<_, _>>()?;
    Ok(binder.join(chunks))
}

/// A bound surface and the buffers of a frame.
struct Live {
    embedding: Embedding,
    normals: SurfaceNormals,
    points: Vec<[f32; 4]>,
    areas: Vec<[f32; 4]>,
    directions: Vec<[f32; 4]>,
}

impl Live {
    fn new(tets: &TetMesh, surface: &TriangleMesh) -> Result<Self> {
        let count = surface.vertices.len();
        let normals = SurfaceNormals::new(&surface.triangles, count);
        Ok(Self {
            embedding: bound(tets, &surface.vertices)?,
            points: vec![[0.0; 4]; count],
            areas: vec![[0.0; 4]; normals.triangles()],
            directions: vec![[0.0; 4]; count],
            normals,
        })
    }

    /// Milliseconds of the positions and of the normals.
    fn frame(&mut self, nodes: &[[f32; 4]]) -> [f64; 2] {
        let Self { embedding, normals, points, areas, directions } = self;
        let begin = Instant::now();
        points.par_chunks_mut(CHUNK).enumerate().for_each(|(c, out)| embedding.apply_from(c * CHUNK, nodes, out));
        let middle = Instant::now();
        let points = &*points;
        areas.par_chunks_mut(CHUNK).enumerate().for_each(|(c, out)| normals.areas_from(c * CHUNK, points, out));
        let areas = &*areas;
        directions.par_chunks_mut(CHUNK).enumerate().for_each(|(c, out)| normals.apply_from(c * CHUNK, areas, out));
        [middle - begin, middle.elapsed()].map(|t| t.as_secs_f64() * 1e3)
    }

    /// Against each point moved by the exact field itself, and the normals of the surface of those.
    fn errors(&self, rest: &TriangleMesh, field: impl Fn(Point<Patient>) -> Point<Patient>) -> Value {
        let vertices: Vec<Point<Patient>> = rest.vertices.iter().map(|&p| field(p)).collect();
        let exact = TriangleMesh { vertices, triangles: rest.triangles.clone() };
        let off: Vec<f64> =
            exact.vertices.iter().zip(&self.points).map(|(p, o)| p.distance(Point::from_array(xyz(o)))).collect();
        let turned: Vec<f64> = exact
            .vertex_normals()
            .into_iter()
            .zip(&self.directions)
            .map(|(n, d)| n.dot(Vector::from_array(xyz(d))).clamp(-1.0, 1.0).acos().to_degrees())
            .collect();
        json!({
            "radians": TWIST, "error_mean_mm": off.iter().sum::<f64>() / off.len().max(1) as f64,
            "error_p99_mm": quantile(&off, 0.99), "error_max_mm": quantile(&off, 1.0),
            "normal_mean_deg": turned.iter().sum::<f64>() / turned.len().max(1) as f64,
            "normal_p99_deg": quantile(&turned, 0.99),
        })
    }
}

/// The surface with about as many points as asked for: triangles split into four, then decimated.
fn with_points(surface: &TriangleMesh, points: usize) -> TriangleMesh {
    let mut mesh = surface.clone();
    while mesh.vertices.len() < points && !mesh.triangles.is_empty() {
        mesh = quartered(&mesh);
    }
    decimate(&mesh, 2 * points)
}

fn quartered(mesh: &TriangleMesh) -> TriangleMesh {
    let mut vertices = mesh.vertices.clone();
    let mut middles = std::collections::BTreeMap::new();
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| {
            *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                vertices.push(mesh.vertices[p as usize].lerp(mesh.vertices[q as usize], 0.5));
                vertices.len() as u32 - 1
            })
        });
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    TriangleMesh { vertices, triangles }
}

fn twist(tets: &TetMesh) -> impl Fn(Point<Patient>) -> Point<Patient> {
    let [low, high] = bounds(tets.vertices.iter().map(|p| p.to_array())).unwrap_or_default();
    let centre: [f64; 3] = core::array::from_fn(|a| 0.5 * (low[a] + high[a]));
    let per_mm = TWIST / (high[2] - low[2]).max(f64::MIN_POSITIVE);
    move |p| {
        let (s, c) = (per_mm * (p.z - centre[2])).sin_cos();
        let (x, y) = (p.x - centre[0], p.y - centre[1]);
        Point::new(centre[0] + c * x - s * y, centre[1] + s * x + c * y, p.z)
    }
}

fn lanes(p: Point<Patient>) -> [f32; 4] {
    [p.x as f32, p.y as f32, p.z as f32, 0.0]
}

fn xyz(p: &[f32; 4]) -> [f64; 3] {
    [p[0], p[1], p[2]].map(f64::from)
}
