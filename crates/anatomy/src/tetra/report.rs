//! What can be said of a mesh: shape, spacing, and how well it keeps each label.

use super::difference;
use super::fields::LabelFields;
use super::repair::Crumb;
use super::size::SizeField;
use crate::surface::isosurface;
use monro_geometry::{Bvh, Point, TetMesh, TriangleMesh};
use rayon::prelude::*;

/// Points per surface and direction for the distances.
const SAMPLES: usize = 10_000;
/// Bounds of the bands of distance in mm.
const BANDS: [f64; 8] = [0.0, 0.9, 2.0, 5.0, 10.0, 20.0, 40.0, f64::INFINITY];

/// Mean edge length in a band of distance from the fine labels and the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeBand {
    /// From this distance, mm; the first band is what lies inside.
    pub from: f64,
    /// To this distance, mm.
    pub to: f64,
    /// Mean length, mm; 0 when there is no edge.
    pub mean: f64,
    /// Edges counted.
    pub edges: usize,
}

/// Distance between an interface of the mesh and the surface of the smoothed labels, the worse of both directions, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InterfaceDistance {
    /// Mean.
    pub mean: f64,
    /// Maximum over the sampled points.
    pub max: f64,
    /// Where it is, LPS mm.
    pub max_at: [f64; 3],
}

/// One label of the mesh against its voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelReport {
    /// The label.
    pub label: u16,
    /// Elements.
    pub elements: usize,
    /// Volume of its elements, mm3.
    pub volume: f64,
    /// Volume over that of the voxels, minus 1.
    pub volume_error: f64,
    /// Its surface against the surface of the smoothed labels; `None` when either has none.
    pub interface: Option<InterfaceDistance>,
    /// Euler number of its surface (2 for a ball).
    pub euler: i64,
    /// Euler number of the smoothed labels' surface.
    pub euler_labels: i64,
    /// Connected surfaces, cavities included.
    pub surfaces: usize,
    /// Connected surfaces of the smoothed labels.
    pub surfaces_labels: usize,
    /// Where the two surfaces differ most in kind, if their Euler numbers or pieces do: a point of the smallest piece where
    /// one has more, else where a handle or a hole is likeliest; LPS mm.
    pub differs_at: Option<[f64; 3]>,
    /// Every edge of its surface has two faces or more.
    pub closed: bool,
    /// Every edge has two faces, every point one fan.
    pub manifold: bool,
}

/// Numbers about a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshReport {
    /// Elements.
    pub elements: usize,
    /// Vertices.
    pub vertices: usize,
    /// Smallest dihedral angle, degrees.
    pub dihedral_min: f64,
    /// Largest dihedral angle, degrees.
    pub dihedral_max: f64,
    /// First percentile of the elements' smallest dihedral angles, degrees.
    pub dihedral_p1: f64,
    /// Smallest radius ratio (1 for a regular element).
    pub radius_ratio_min: f64,
    /// Median radius ratio.
    pub radius_ratio_median: f64,
    /// Mean edge within 2 mm of the fine labels and the path, inside included, mm.
    pub core_edge_mean: f64,
    /// Mean edges by distance.
    pub edge_bands: Vec<EdgeBand>,
    /// Each label.
    pub labels: Vec<LabelReport>,
    /// Something kept reaches the border of the volume and is cut there.
    pub open_at_border: bool,
    /// There were too few elements for surfaces of the inner labels: they are regions of about their volume.
    pub coarse_regions: bool,
    /// What a user should know: pieces given away, labels that lost their shape, volume or topology.
    pub remarks: Vec<String>,
}

pub(super) fn report(
    mesh: &TetMesh,
    fields: &LabelFields,
    size: &SizeField,
    crumbs: &[Crumb],
    coarse_regions: bool,
) -> MeshReport {
    let shapes: Vec<_> = (0..mesh.tets.len()).into_par_iter().map(|t| mesh.quality(t)).collect();
    let mut low: Vec<f64> = shapes.iter().map(|q| q.min_dihedral.to_degrees()).collect();
    let mut ratio: Vec<f64> = shapes.iter().map(|q| q.radius_ratio).collect();
    low.sort_unstable_by(f64::total_cmp);
    ratio.sort_unstable_by(f64::total_cmp);
    let (edge_bands, core_edge_mean) = spacing(mesh, size);
    let labels: Vec<LabelReport> = (0..fields.labels.len()).map(|l| label_report(mesh, fields, l)).collect();
    let at = |sorted: &[f64], part: usize| sorted.get(sorted.len() * part / 100).copied().unwrap_or(0.0);
    MeshReport {
        elements: mesh.tets.len(),
        vertices: mesh.vertices.len(),
        dihedral_min: at(&low, 0),
        dihedral_max: shapes.iter().map(|q| q.max_dihedral.to_degrees()).fold(0.0, f64::max),
        dihedral_p1: at(&low, 1),
        radius_ratio_min: at(&ratio, 0),
        radius_ratio_median: at(&ratio, 50),
        core_edge_mean,
        edge_bands,
        coarse_regions,
        remarks: remarks(&labels, crumbs, coarse_regions),
        labels,
        open_at_border: fields.at_border,
    }
}

/// Beyond this part the volume of a label is worth a remark.
const VOLUME_ERROR: f64 = 0.01;
/// Beyond this mean distance, mm, the surface of a label is.
const SURFACE_ERROR: f64 = 1.5;

fn remarks(labels: &[LabelReport], crumbs: &[Crumb], coarse_regions: bool) -> Vec<String> {
    let mut all = Vec::new();
    if coarse_regions {
        all.push("too few elements for the surfaces of the inner labels: only the outer surface is followed, the labels are coarse regions of about their volume, which may touch themselves in edges and points".into());
    }
    for (i, l) in labels.iter().enumerate() {
        let of_label = || crumbs.iter().filter(|c| usize::from(c.label) == i);
        let (pieces, volume) = (of_label().count(), of_label().map(|c| c.volume).sum::<f64>());
        if pieces > 0 {
            let size = volume / 1000.0;
            all.push(format!("label {}: {pieces} separate piece(s) of {size:.3} ml in all are too small for elements of their own and are counted to what lies around them", l.label));
        }
        if l.elements == 0 {
            all.push(format!("label {} has no element: it is too thin for this number of elements", l.label));
            continue;
        }
        if let Some([x, y, z]) = l.differs_at {
            all.push(format!(
                "label {}: its surface has Euler number {} in {} piece(s), that of the labels {} in {}; look near ({x:.1}, {y:.1}, {z:.1}) mm",
                l.label, l.euler, l.surfaces, l.euler_labels, l.surfaces_labels
            ));
        }
        if !(coarse_regions || l.closed && l.manifold) {
            all.push(format!("label {}: its surface is not two-manifold", l.label));
        }
        if l.volume_error.abs() > VOLUME_ERROR {
            all.push(format!("label {}: {:+.1} % of its volume", l.label, l.volume_error * 100.0));
        }
        if let Some(d) = l.interface.filter(|d| d.mean > SURFACE_ERROR) {
            all.push(format!("label {} is a coarse region: its surface is {:.1} mm off on average", l.label, d.mean));
        }
    }
    all
}

fn spacing(mesh: &TetMesh, size: &SizeField) -> (Vec<EdgeBand>, f64) {
    let mut sums = [(0.0, 0usize); BANDS.len() - 1];
    for e in mesh.edges() {
        let [a, b] = e.map(|v| mesh.vertices[v as usize]);
        let d = size.distance(a.lerp(b, 0.5).to_array());
        let band = BANDS[1..BANDS.len() - 1].iter().filter(|&&x| d >= x).count();
        sums[band] = (sums[band].0 + a.distance(b), sums[band].1 + 1);
    }
    let mean = |s: (f64, usize)| if s.1 == 0 { 0.0 } else { s.0 / s.1 as f64 };
    let band = |i: usize| EdgeBand { from: BANDS[i], to: BANDS[i + 1], mean: mean(sums[i]), edges: sums[i].1 };
    let core = sums[..2].iter().fold((0.0, 0), |s, x| (s.0 + x.0, s.1 + x.1));
    ((0..sums.len()).map(band).collect(), mean(core))
}

fn label_report(mesh: &TetMesh, fields: &LabelFields, l: usize) -> LabelReport {
    let label = fields.labels[l];
    let surface = mesh.surface(|x| x == label);
    let truth = without_specks(isosurface(&fields.margins(l), 0.0), fields.step.powi(3));
    let (found, wanted) = (surface.topology(), truth.topology());
    let volume = mesh.label_volume(label);
    LabelReport {
        label,
        elements: mesh.labels.iter().filter(|&&x| x == label).count(),
        volume,
        volume_error: volume / fields.volumes[l] - 1.0,
        interface: distances(&surface, &truth),
        euler: found.euler(),
        euler_labels: wanted.euler(),
        surfaces: found.components,
        surfaces_labels: wanted.components,
        differs_at: ((found.euler(), found.components) != (wanted.euler(), wanted.components))
            .then(|| difference::place(&surface, &truth)),
        closed: found.is_closed(),
        manifold: found.is_manifold(),
    }
}

/// Drops pieces that enclose less than `volume` mm3: crumbs of the smoothing, smaller than a cell.
fn without_specks(mut surface: TriangleMesh, volume: f64) -> TriangleMesh {
    let (piece, count) = surface.components();
    if count < 2 {
        return surface;
    }
    let mut volumes = vec![0.0; count];
    for (t, &p) in piece.iter().enumerate() {
        let [a, b, c] = surface.corners(t).map(|p| p - Point::ORIGIN);
        volumes[p as usize] += a.dot(b.cross(c)) / 6.0;
    }
    let mut each = piece.iter();
    surface.triangles.retain(|_| each.next().is_some_and(|&p| volumes[p as usize].abs() >= volume));
    surface
}

fn distances(a: &TriangleMesh, b: &TriangleMesh) -> Option<InterfaceDistance> {
    let (there, back) = (one_way(a, b)?, one_way(b, a)?);
    let far = if there.max >= back.max { there } else { back };
    Some(InterfaceDistance { mean: there.mean.max(back.mean), ..far })
}

/// From the vertices and centroids of one surface to the other.
fn one_way(from: &TriangleMesh, to: &TriangleMesh) -> Option<InterfaceDistance> {
    let count = from.vertices.len() + from.triangles.len();
    let stride = count.div_ceil(SAMPLES).max(1);
    let point = |i: usize| match from.vertices.get(i) {
        Some(&p) => p,
        None => {
            let c = from.corners(i - from.vertices.len());
            Point::from_array(std::array::from_fn(|a| c.iter().map(|p| p.to_array()[a]).sum::<f64>() / 3.0))
        }
    };
    let bvh = Bvh::new(to);
    let samples: Vec<usize> = (0..count).step_by(stride).collect();
    let all: Vec<(f64, usize)> =
        samples.into_par_iter().filter_map(|i| bvh.nearest(point(i)).map(|n| (n.distance, i))).collect();
    let &(max, at) = all.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let mean = all.iter().map(|d| d.0).sum::<f64>() / all.len() as f64;
    Some(InterfaceDistance { mean, max, max_at: point(at).to_array() })
}
