//! What can be said of a mesh: shape, spacing, and how well it keeps each label.

use super::coarse::Lost;
use super::fields::LabelFields;
use super::size::SizeField;
use super::solid::Solid;
use super::torn::Torn;
use super::voxels::{Voxels, centre};
use super::{Crumb, MeshOptions, difference, place, remarks};
use crate::shapes::ShapeSummary;
use crate::surface::even::Extent;
use crate::surface::isosurface;
use monro_geometry::d3::{D3, add, scale};
use monro_geometry::{Bvh, Overlap, Patient, Point, SelfCrossing, TetLocator, TetMesh, TriangleMesh};
use rayon::prelude::*;
use std::fmt;

/// Points per surface and direction for the distances.
const SAMPLES: usize = 10_000;
/// Edges of the elements there that a surface may be off, and cells of the smooth fields: tips of wedges lose a few.
const MOST_EDGES_OFF: f64 = 1.5;
const MOST_CELLS_OFF: f64 = 5.0;
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
    /// Edges counted, by their middles.
    pub edges: usize,
    /// Elements whose centroid lies in the band.
    pub elements: usize,
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
    /// Edge of the elements wanted there, mm.
    pub edge: f64,
    /// Edge of the smooth fields' cells, mm.
    pub step: f64,
}

impl InterfaceDistance {
    /// Whether the surfaces are farther apart somewhere than elements or cells are coarse there. On heads and phantoms they are by
    /// up to 0.9 edges, where furrows are narrow, with the usual options; by several where a flat slit is bridged, or where
    /// a label that is thin against its elements is lost.
    pub fn is_far(&self) -> bool {
        self.max > (MOST_EDGES_OFF * self.edge).max(MOST_CELLS_OFF * self.step)
    }
}

impl fmt::Display for InterfaceDistance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { max, max_at, edge, .. } = *self;
        write!(
            f,
            "the surface and that of the smoothed voxels are {max:.1} mm apart near {}, where edges are {edge:.1} mm: what is thin against these (horns, slits, tunnels, sheets, specks) is bridged or lost there; be fine around the label or ask for more elements, and where it is no wider than a voxel or two relabel it, make it wider or resample the labels to voxels of half the size",
            place(max_at)
        )
    }
}

/// Holes, tunnels and slits that are no wider than a voxel or two, or cells of the smooth fields: these do not keep them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosedGaps {
    /// Voxels of none of the labels that lie within.
    pub voxels: usize,
    /// The centre of one of them, LPS mm.
    pub at: [f64; 3],
    /// Edge of the fields' cells, mm.
    pub step: f64,
}

impl fmt::Display for ClosedGaps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { voxels, at, step } = *self;
        write!(
            f,
            "{voxels} voxel(s) of none of the labels, one at {}, lie in the mesh: holes, tunnels or slits that are no wider than a cell or two of the smooth fields ({step:.2} mm) close in them; label them, or resample the labels to voxels of half the size if these are not smaller than such cells already (in what is large, cells are)",
            place(at)
        )
    }
}

/// Which surface of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Boundary {
    /// That of a label.
    Label(u16),
    /// The outer one: that of all labels together.
    Outer,
}

impl fmt::Display for Boundary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Label(label) => write!(f, "label {label}"),
            Self::Outer => f.write_str("all labels together"),
        }
    }
}

/// Topology of a surface of the mesh against that of the smoothed labels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceReport {
    /// Euler number (2 for a ball).
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
    /// Every edge has two faces or more.
    pub closed: bool,
    /// Every edge has two faces, every point one fan.
    pub manifold: bool,
    /// A place where it is open or meets itself in an edge or a point, LPS mm.
    pub pinched_at: Option<[f64; 3]>,
}

impl SurfaceReport {
    /// Of a surface of the mesh and one of the labels; `unit` is what stands for a millimetre.
    fn new(surface: &TriangleMesh, truth: &TriangleMesh, unit: f64) -> Self {
        let (found, wanted) = (surface.topology(), truth.topology());
        let differs = (found.euler(), found.components) != (wanted.euler(), wanted.components);
        let sound = found.is_closed() && found.is_manifold();
        Self {
            euler: found.euler(),
            euler_labels: wanted.euler(),
            surfaces: found.components,
            surfaces_labels: wanted.components,
            differs_at: differs
                .then(|| difference::place((surface, found.components), (truth, wanted.components), unit)),
            closed: found.is_closed(),
            manifold: found.is_manifold(),
            pinched_at: if sound { None } else { surface.defect().map(Point::to_array) },
        }
    }
}

/// Elements that miss [`LEAST_DIHEDRAL`], [`LARGEST_DIHEDRAL`] or [`LEAST_RADIUS_RATIO`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BadShapes {
    /// Elements.
    pub count: usize,
    /// Centroid of the worst, LPS mm.
    pub worst_at: [f64; 3],
}

/// Dihedral angles below this, degrees,
pub const LEAST_DIHEDRAL: f64 = 12.0;
/// or above this,
pub const LARGEST_DIHEDRAL: f64 = 155.0;
/// or radius ratios below this are worth a remark, and refused by [`MeshOptions::strict`],
pub const LEAST_RADIUS_RATIO: f64 = 0.2;
/// and so is a volume of a label that is off by more than this part.
pub const MOST_VOLUME_ERROR: f64 = 0.01;

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
    /// Topology of its surface.
    pub surface: SurfaceReport,
    /// Voxels of the label.
    pub voxels: usize,
    /// The centre of one of its voxels, LPS mm, where it has no element.
    pub lost_at: Option<[f64; 3]>,
    /// Thin parts that the smooth fields have not kept.
    pub torn: Option<Torn>,
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
    /// Mean edge whose middle lies within 2 mm of the path, mm; `None` without a path, or where it meets no such edge.
    pub path_edge_mean: Option<f64>,
    /// Mean edges by distance.
    pub edge_bands: Vec<EdgeBand>,
    /// Elements of bad shape, if any.
    pub bad_shapes: Option<BadShapes>,
    /// Each label.
    pub labels: Vec<LabelReport>,
    /// The surface of all labels together.
    pub outer: SurfaceReport,
    /// Something kept reaches the border of the volume and is cut there.
    pub open_at_border: bool,
    /// There were too few elements for surfaces of the inner labels: they are regions of about their volume.
    pub coarse_regions: bool,
    /// What was closed although the labels leave it open.
    pub closed_gaps: Option<ClosedGaps>,
    /// Elements that lie in others, where walls that face each other pass through each other.
    pub overlap: Option<Overlap>,
    /// Where the outer surface passes through itself, also where no element is deep enough in another to be found so.
    pub self_crossing: Option<SelfCrossing>,
    /// What a user should know: labels asked for that are not there, a count or volumes missed, bad shapes, pieces given
    /// away, labels that lost their shape or topology.
    pub remarks: Vec<String>,
    /// Where surfaces have other handles or pieces than those of the labels or are far from them, and gaps that they lack, in
    /// words.
    pub topology: Vec<String>,
}

/// Pieces of less than this part of a voxel are none of the labels: two fields touch there.
const CRUMB: f64 = 0.05;

/// What a mesh was made from.
pub(super) struct Source<'a, T> {
    pub(super) voxels: Voxels<'a, T>,
    pub(super) options: &'a MeshOptions,
    pub(super) fields: &'a LabelFields,
    pub(super) size: &'a SizeField,
    pub(super) crumbs: &'a [Crumb],
    pub(super) regions: Option<Lost>,
    /// The finest edge wanted for the mesh's elements, mm.
    pub(super) finest: f64,
}

impl<T> Source<'_, T> {
    /// Edge of the elements wanted at a point, mm.
    pub(super) fn edge(&self, p: D3) -> f64 {
        self.size.edge(p, self.finest)
    }
}

pub(super) fn report<T: Copy + Eq + Into<u16> + Sync>(mesh: &TetMesh, source: &Source<'_, T>) -> MeshReport {
    let fields = source.fields;
    let shapes = ShapeSummary::of(mesh);
    let (edge_bands, core_edge_mean) = spacing(mesh, source.size);
    let outer = without_specks(isosurface(fields.union.volume(), 0.5), fields.step.powi(3), |p, inside| {
        source.voxels.is_separate(p, fields.step, |l| source.options.keep.contains(&l) == inside)
    });
    let surface = mesh.surface(|_| true);
    let absences: Vec<_> = (0..fields.labels.len()).map(|l| remarks::missing(source, l)).collect();
    let locator = TetLocator::new(mesh).expect("a mesh that has just been made");
    let mut report = MeshReport {
        elements: mesh.tets.len(),
        vertices: mesh.vertices.len(),
        dihedral_min: shapes.dihedral_min,
        dihedral_max: shapes.dihedral_max,
        dihedral_p1: shapes.dihedral_p1,
        radius_ratio_min: shapes.radius_ratio_min,
        radius_ratio_median: shapes.radius_ratio_median,
        core_edge_mean,
        path_edge_mean: source.options.path.and_then(|path| along(mesh, path)),
        edge_bands,
        bad_shapes: shapes.bad,
        coarse_regions: source.regions.is_some(),
        closed_gaps: closed_gaps(source),
        overlap: locator.overlap(),
        self_crossing: surface.self_crossing(),
        labels: absences.iter().enumerate().map(|(l, absent)| label_report(mesh, source, l, &absent.0)).collect(),
        outer: SurfaceReport::new(&surface, &outer, fields.unit),
        remarks: Vec::new(),
        topology: Vec::new(),
        open_at_border: fields.at_border,
    };
    let source = &Source { crumbs: &lost(source, mesh, &locator), ..*source };
    report.remarks = remarks::remarks(&report, source, &absences);
    report.topology = remarks::topology(&report);
    report.labels.sort_by_key(|l| l.label);
    report
}

/// Crumbs that were given away with all of their piece of the label; else they were cut off from it, and the rest is there.
fn lost<T: Copy + Eq + Into<u16> + Sync>(source: &Source<'_, T>, mesh: &TetMesh, locator: &TetLocator) -> Vec<Crumb> {
    let is_lost = |c: &&Crumb| {
        let label = source.fields.labels[usize::from(c.label)];
        let is_there = |p| locator.locate(p).is_some_and(|found| mesh.labels[found.tet] == label);
        source.voxels.is_gone(Point::from_array(c.place), label, is_there)
    };
    let of_labels = |c: &&Crumb| c.volume > CRUMB * source.fields.voxel;
    source.crumbs.iter().filter(of_labels).filter(is_lost).copied().collect()
}

fn closed_gaps<T: Copy + Eq + Into<u16> + Sync>(source: &Source<'_, T>) -> Option<ClosedGaps> {
    let (fields, grid) = (source.fields, source.voxels.0.grid());
    let whole = fields.extents.iter().copied().reduce(Extent::joined)?;
    let mut kept = vec![false; 1 << 16];
    fields.labels.iter().for_each(|&l| kept[usize::from(l)] = true);
    let outside = Solid::outside(fields);
    let is_filled = |p| !outside.holds(p) && fields.union.at(p) >= 0.5;
    let filled = source.voxels.filled(&whole, |l| kept[usize::from(l)], is_filled);
    let &one = filled.get(filled.len() / 2)?;
    Some(ClosedGaps { voxels: filled.len(), at: centre(grid, one), step: fields.step })
}

impl MeshReport {
    /// Labels with surfaces that [are far](InterfaceDistance::is_far) from theirs. Those of coarse regions are so anyway.
    pub(super) fn far(&self) -> impl Iterator<Item = (u16, InterfaceDistance)> {
        let of = |l: &LabelReport| Some((l.label, l.interface.filter(InterfaceDistance::is_far)?));
        self.labels.iter().filter(|_| !self.coarse_regions).filter_map(of)
    }

    /// All that there is to say in words.
    pub fn all_remarks(&self) -> Vec<&String> {
        self.remarks.iter().chain(&self.topology).collect()
    }
}

fn centroid<const N: usize>(corners: [Point<Patient>; N]) -> Point<Patient> {
    Point::from_array([0, 1, 2].map(|a| corners.iter().map(|p| p.to_array()[a]).sum::<f64>() / N as f64))
}

fn spacing(mesh: &TetMesh, size: &SizeField) -> (Vec<EdgeBand>, f64) {
    let mut sums = [(0.0, 0usize); BANDS.len() - 1];
    let band =
        |p: Point<Patient>| BANDS[1..BANDS.len() - 1].iter().filter(|&&x| size.distance(p.to_array()) >= x).count();
    for e in mesh.edges() {
        let [a, b] = e.map(|v| mesh.vertices[v as usize]);
        let sum = &mut sums[band(a.lerp(b, 0.5))];
        *sum = (sum.0 + a.distance(b), sum.1 + 1);
    }
    let mut elements = [0; BANDS.len() - 1];
    (0..mesh.tets.len()).for_each(|t| elements[band(centroid(mesh.corners(t)))] += 1);
    let mean = |s: (f64, usize)| if s.1 == 0 { 0.0 } else { s.0 / s.1 as f64 };
    let band = |i: usize| EdgeBand {
        from: BANDS[i],
        to: BANDS[i + 1],
        mean: mean(sums[i]),
        edges: sums[i].1,
        elements: elements[i],
    };
    let core = sums[..2].iter().fold((0.0, 0), |s, x| (s.0 + x.0, s.1 + x.1));
    ((0..sums.len()).map(band).collect(), mean(core))
}

/// Mean edge whose middle lies as near to a path as the core reaches, mm.
fn along(mesh: &TetMesh, [from, to]: [Point<Patient>; 2]) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0usize);
    for e in mesh.edges() {
        let [a, b] = e.map(|v| mesh.vertices[v as usize]);
        let middle = a.lerp(b, 0.5);
        if middle.distance(middle.nearest_on_segment(from, to)) < BANDS[2] {
            (sum, count) = (sum + a.distance(b), count + 1);
        }
    }
    (count > 0).then(|| sum / count as f64)
}

fn label_report<T: Copy + Eq + Into<u16> + Sync>(
    mesh: &TetMesh,
    source: &Source<'_, T>,
    l: usize,
    absent: &[usize],
) -> LabelReport {
    let (fields, voxels) = (source.fields, &source.voxels);
    let label = fields.labels[l];
    let surface = mesh.surface(|x| x == label);
    let truth = without_specks(isosurface(&fields.margins(l), 0.0), fields.step.powi(3), |p, inside| {
        voxels.is_separate(p, fields.step, |x| (x == label) == inside)
    });
    let volume = mesh.label_volume(label);
    let elements = mesh.labels.iter().filter(|&&x| x == label).count();
    LabelReport {
        label,
        elements,
        volume,
        volume_error: volume / (fields.extents[l].count as f64 * fields.voxel) - 1.0,
        interface: distances(&surface, &truth, source),
        surface: SurfaceReport::new(&surface, &truth, fields.unit),
        voxels: fields.extents[l].count,
        lost_at: (elements == 0).then(|| voxels.one(|x| x == label)),
        torn: voxels.torn(absent, label, fields.step).filter(|_| elements > 0),
    }
}

/// Drops pieces that enclose less than `volume` mm3: crumbs of the smoothing, smaller than a cell. Those that `is_voxels`
/// knows stay: around a point, whether pieces stand for what is inside or are holes in it.
fn without_specks(
    mut surface: TriangleMesh,
    volume: f64,
    is_voxels: impl Fn(Point<Patient>, bool) -> bool,
) -> TriangleMesh {
    let (piece, count) = surface.components();
    if count < 2 {
        return surface;
    }
    let mut pieces = vec![(0.0, [0.0; 3], 0usize); count];
    for (t, &p) in piece.iter().enumerate() {
        let corners = surface.corners(t);
        let [a, b, c] = corners.map(|p| p - Point::ORIGIN);
        let (sum, middle, n) = &mut pieces[p as usize];
        *sum += a.dot(b.cross(c)) / 6.0;
        *middle = add(*middle, centroid(corners).to_array());
        *n += 1;
    }
    let stays = |&(sum, middle, n): &(f64, D3, usize)| {
        sum.abs() >= volume || is_voxels(Point::from_array(scale(middle, 1.0 / n.max(1) as f64)), sum > 0.0)
    };
    let stays: Vec<bool> = pieces.iter().map(stays).collect();
    let mut each = piece.iter();
    surface.triangles.retain(|_| each.next().is_some_and(|&p| stays[p as usize]));
    surface
}

fn distances<T>(a: &TriangleMesh, b: &TriangleMesh, source: &Source<'_, T>) -> Option<InterfaceDistance> {
    let (there, back) = (one_way(a, b)?, one_way(b, a)?);
    let (_, max, max_at) = if there.1 >= back.1 { there } else { back };
    let (edge, step) = (source.edge(max_at), source.fields.step);
    Some(InterfaceDistance { mean: there.0.max(back.0), max, max_at, edge, step })
}

/// From the vertices and centroids of one surface to the other: the mean and the largest distance, and where that is.
fn one_way(from: &TriangleMesh, to: &TriangleMesh) -> Option<(f64, f64, D3)> {
    let count = from.vertices.len() + from.triangles.len();
    let stride = count.div_ceil(SAMPLES).max(1);
    let point = |i: usize| match from.vertices.get(i) {
        Some(&p) => p,
        None => centroid(from.corners(i - from.vertices.len())),
    };
    let bvh = Bvh::new(to);
    let samples: Vec<usize> = (0..count).step_by(stride).collect();
    let all: Vec<(f64, usize)> =
        samples.into_par_iter().filter_map(|i| bvh.nearest(point(i)).map(|n| (n.distance, i))).collect();
    let &(max, at) = all.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let mean = all.iter().map(|d| d.0).sum::<f64>() / all.len() as f64;
    Some((mean, max, point(at).to_array()))
}
