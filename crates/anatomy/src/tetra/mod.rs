//! Graded tetrahedra from a label volume.
//!
//! The route: smooth fields of the labels, a size field from distances, a graded body-centred-cubic lattice over a
//! balanced octree, cutting along all label surfaces in one global order, local improvement.
//!
//! ```
//! use monro_anatomy::tetra::{MeshOptions, mesh};
//! use monro_geometry::{Grid, Point, Volume};
//!
//! // A ball of 10 mm with a ball of 5 mm in it, in voxels of 1 x 1 x 1.5 mm.
//! let grid = Grid::axis_aligned([24, 24, 16], [1.0, 1.0, 1.5], [-11.5, -11.5, -11.25])?;
//! let mut labels = Volume::filled(grid.clone(), 0u16);
//! for (i, label) in labels.data_mut().iter_mut().enumerate() {
//!     let [x, y, z] = grid.voxel(i);
//!     let radius = grid.centre(x, y, z).distance(Point::new(0.0, 0.0, 0.0));
//!     *label = if radius < 5.0 { 5 } else if radius < 10.0 { 4 } else { 0 };
//! }
//! // Both labels, fine around the inner one.
//! let (tets, report) = mesh(&labels, &MeshOptions::new(&[4, 5], &[5], 2000))?;
//! assert!(report.remarks.is_empty(), "{:?}", report.remarks);
//! let voxels = labels.data().iter().filter(|&&l| l == 5).count();
//! let volume = voxels as f64 * grid.voxel_volume();
//! assert!((tets.label_volume(5) / volume - 1.0).abs() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod adjacency;
mod along;
mod bodies;
mod cells;
mod census;
mod cleared;
mod coarse;
mod cut;
mod difference;
mod draw;
mod error;
mod fields;
mod gaps;
mod improve;
mod lattice;
mod nearby;
mod octree;
mod order;
mod quality;
mod region;
mod remainder;
mod remarks;
mod repair;
mod report;
mod size;
mod smooth;
mod solid;
mod start;
mod thickness;
mod torn;
mod voxels;

pub use error::MeshError;
pub use report::{
    BadShapes, Boundary, ClosedGaps, EdgeBand, InterfaceDistance, LARGEST_DIHEDRAL, LEAST_DIHEDRAL, LEAST_RADIUS_RATIO,
    LabelReport, MOST_VOLUME_ERROR, MeshReport, SurfaceReport,
};
pub use torn::Torn;

use cleared::Cleared;
use coarse::Lost;
use cut::RawMesh;
use error::{listed, place};
use fields::LabelFields;
use improve::{Bounds, Coarse, MOST_LABELS, Work};
use monro_geometry::{Patient, Point, TetMesh, Volume, d3};
use repair::Crumb;
use report::Source;
use size::SizeField;
use start::{USUAL_GROWTH, first_cell};
use voxels::Voxels;

/// Numbers of elements that can be asked for.
pub const ELEMENTS: std::ops::RangeInclusive<usize> = 500..=20_000_000;
/// Growths of edges, mm a mm, that can be asked for.
pub const GROWTH: std::ops::RangeInclusive<f64> = 0.01..=2.0;
/// Longest edges over the finest that can be asked for.
pub const COARSEST: std::ops::RangeInclusive<f64> = 1.0..=64.0;

/// What to mesh and how finely.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshOptions {
    /// Labels to mesh; everything else is outside.
    pub keep: Vec<u16>,
    /// Labels to be fine in and around.
    pub fine: Vec<u16>,
    /// Densities of labels relative to 1, the others': how many more elements a volume of them gets, as soft tissue that
    /// deforms strongly deserves (Kim, Kwon and Shin 2021). Edges are shorter by the cube root. Cells of the lattice halve, so
    /// what comes of it lies near 1, 8, 64: the report says where that misses what is wanted.
    pub density: Vec<(u16, f64)>,
    /// A planned path to be fine along, e.g. entry and target.
    pub path: Option<[Point<Patient>; 2]>,
    /// Wanted number of elements.
    pub elements: usize,
    /// Growth of the edge length with the distance from what is fine, mm a mm.
    pub growth: f64,
    /// Longest edge over the finest.
    pub coarsest: f64,
    /// Refuse a mesh in which the surface of a label, or of all together, is not two-manifold or has another Euler number or
    /// number of pieces than the smoothed labels or [is far](InterfaceDistance::is_far) from theirs, gaps are closed that the
    /// labels leave open, a label has no element, its volume is off by more than [`MOST_VOLUME_ERROR`], or an element is worse than [`LEAST_DIHEDRAL`], [`LARGEST_DIHEDRAL`] or
    /// [`LEAST_RADIUS_RATIO`]; otherwise the report's remarks say so.
    pub strict: bool,
}

impl MeshOptions {
    /// The usual grading for these labels and this count.
    pub fn new(keep: &[u16], fine: &[u16], elements: usize) -> Self {
        Self {
            keep: keep.to_vec(),
            fine: fine.to_vec(),
            density: Vec::new(),
            path: None,
            elements,
            growth: USUAL_GROWTH,
            coarsest: 5.0,
            strict: false,
        }
    }
}

/// Meshes the labels in `options.keep` of a label volume.
///
/// Faces conform between all labels and at the outer surface; elements carry the values of the volume as labels; all
/// have positive volume. Where there are too few elements for the surfaces of the inner labels, these become coarse regions
/// of about their volume, and the report says so. The same input gives the same bits on any number of threads.
///
/// # Errors
/// Nothing to mesh, options out of range, or a count that cannot be met within 5 % (2 % is aimed at); with
/// [`MeshOptions::strict`] what that refuses.
pub fn mesh<T: Copy + Eq + Into<u16> + Sync>(
    labels: &Volume<T>,
    options: &MeshOptions,
) -> Result<(TetMesh, MeshReport), MeshError> {
    mesh_observed(labels, options, |_| {})
}

/// A stage of [`mesh`] that has just ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Smooth fields of the labels.
    Fields,
    /// Size field.
    Size,
    /// Octree, lattice and cuts, as often as the count needs; two-manifold labels.
    Cut,
    /// Coarsening to the count.
    Coarsen,
    /// Volumes of the labels, shapes of the elements.
    Improve,
    /// Report.
    Report,
}

impl Stage {
    /// Its name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fields => "fields",
            Self::Size => "size",
            Self::Cut => "cut",
            Self::Coarsen => "coarsen",
            Self::Improve => "improve",
            Self::Report => "report",
        }
    }
}

/// As [`mesh`], telling `done` at the end of each stage (for progress and timing; this crate has no clock).
///
/// # Errors
/// As [`mesh`].
pub fn mesh_observed<T: Copy + Eq + Into<u16> + Sync>(
    labels: &Volume<T>,
    options: &MeshOptions,
    mut done: impl FnMut(Stage),
) -> Result<(TetMesh, MeshReport), MeshError> {
    check(options)?;
    let voxels = Voxels(labels);
    let empty =
        || MeshError::Empty { keep: options.keep.clone(), voxels: labels.grid().len(), present: voxels.present() };
    let mut fields = LabelFields::new(labels, &options.keep).ok_or_else(empty)?;
    voxels.leave_out_missing(&mut fields);
    voxels.note_specks(&mut fields);
    done(Stage::Fields);
    let fine: Vec<usize> = (0..fields.labels.len()).filter(|&i| options.fine.contains(&fields.labels[i])).collect();
    let size = SizeField::new(&fields, &fine, options).ok_or_else(empty)?;
    done(Stage::Size);
    let kept = |l: u16| options.keep.contains(&l);
    let too_thin = || {
        let (voxels, at) = (fields.extents.iter().map(|e| e.count).sum(), voxels.one(kept));
        match first_cell(&size, options.elements, &fields) {
            cell if cell > 2.0 * fields.step => MeshError::TooFew { wanted: options.elements, voxels, at, cell },
            _ => MeshError::TooThin { voxels, at, step: fields.step },
        }
    };
    let made = Made::conforming(&fields, &size, options.elements, 1.0, &mut done).ok_or_else(too_thin)?;
    let made = made.or_from_finer(&fields, &size, options.elements, &mut done);
    let made = match made.is_good(&fields, options.elements) {
        true => made,
        false => {
            let why = made.lost.unwrap_or(Lost::Inner);
            Made::with_regions(&fields, &size, options.elements, &mut done, why).ok_or_else(too_thin)?
        }
    };
    done(Stage::Improve);
    let found = made.raw.tets.len();
    if !made.has_count(options.elements, ACCEPTED) {
        return Err(MeshError::Count { wanted: options.elements, found });
    }
    let mesh = finish(made.raw, &fields);
    not_inverted(&mesh)?;
    let (crumbs, regions) = (&made.crumbs, made.regions);
    let finest = start::even_edge_for(&size, found as f64);
    let source = Source { voxels, options, fields: &fields, size: &size, crumbs, regions, finest };
    let report = report::report(&mesh, &source);
    done(Stage::Report);
    if options.strict {
        strictly(&report)?;
    }
    Ok((mesh, report))
}

/// A mesh and how it was made.
struct Made {
    raw: RawMesh,
    crumbs: Vec<Crumb>,
    /// Why labels are not represented by their surfaces and are to be regions, if they are.
    lost: Option<Lost>,
    /// Whether the inner labels are regions without surfaces of their own.
    regions: Option<Lost>,
    /// Whether the lattice had cells too large to show all of the labels.
    blind: bool,
}

impl Made {
    /// With faces along all label surfaces, from a lattice for `more` times as many elements; `None` where nothing is left to mesh.
    fn conforming(
        fields: &LabelFields,
        size: &SizeField,
        wanted: usize,
        more: f64,
        done: &mut impl FnMut(Stage),
    ) -> Option<Self> {
        let mut kept = None;
        let (mut best, mut aim) = (Self::once(fields, size, (wanted, more), &mut kept, done)?, wanted as f64);
        let mut last = best.raw.tets.len();
        for _ in 0..if wanted < FEW { MORE_TRIES } else { 1 } {
            if best.has_count(wanted, COUNT) || last == 0 || best.lost.is_some() {
                break;
            }
            // What the last one is short of is asked for on top.
            aim *= wanted as f64 / last as f64;
            aim = aim.clamp(0.8 * wanted as f64, 1.25 * wanted as f64);
            let Some(other) = Self::once(fields, size, (aim as usize, more), &mut kept, done) else { break };
            if other.raw.tets.len() == last {
                // What is left cannot be coarsened any more.
                break;
            }
            last = other.raw.tets.len();
            if other.miss(wanted) < best.miss(wanted) {
                best = other;
            }
        }
        Some(best)
    }

    /// From what was `kept` of an earlier lattice, where that has room.
    fn once<'a>(
        fields: &'a LabelFields,
        size: &SizeField,
        (aim, more): (usize, f64),
        kept: &mut Option<Cleared<'a>>,
        done: &mut impl FnMut(Stage),
    ) -> Option<Self> {
        let cleared = match kept.take().filter(|cleared| cleared.has_room(aim)) {
            Some(cleared) => cleared,
            None => Cleared::with_room(fields, size, aim, more)?,
        };
        *kept = cleared.kept();
        done(Stage::Cut);
        Some(improved(cleared, fields, size, aim, done))
    }

    /// Made again from a much finer lattice, where the one that it was cut from was too coarse for small pieces and thin parts: these
    /// take so many cells that all others were made large to meet the count, until nothing was seen of what they are for.
    fn or_from_finer(
        self,
        fields: &LabelFields,
        size: &SizeField,
        wanted: usize,
        done: &mut impl FnMut(Stage),
    ) -> Self {
        let lacks = || (0..fields.labels.len()).any(|l| self.given_away(Some(l)) > LACKS * fields.volumes[l]);
        if !self.blind || (self.lost.is_none() && !lacks()) {
            return self;
        }
        let is_better = |other: &Self| {
            let less = other.given_away(None) < self.given_away(None);
            other.is_good(fields, wanted) && (less || !self.is_good(fields, wanted))
        };
        Self::conforming(fields, size, wanted, FINER, done).filter(is_better).unwrap_or(self)
    }

    /// With faces along the outer surface only.
    fn with_regions(
        fields: &LabelFields,
        size: &SizeField,
        wanted: usize,
        done: &mut impl FnMut(Stage),
        why: Lost,
    ) -> Option<Self> {
        let made = Self::conforming(&fields.as_one(), size, wanted, 1.0, done)?;
        let mut raw = made.raw;
        coarse::label_regions(&mut raw, fields);
        // Until now there was one label, that of all.
        let of = |c: Crumb| Crumb { label: fields.likeliest_at(c.place) as u8, ..c };
        let crumbs = made.crumbs.into_iter().map(of).collect();
        Some(Self { raw, crumbs, regions: Some(why), ..made })
    }

    /// How much of a label, or of all, was given to others, mm3.
    fn given_away(&self, label: Option<usize>) -> f64 {
        let of = |c: &&Crumb| label.is_none_or(|l| usize::from(c.label) == l);
        self.crumbs.iter().filter(of).map(|c| c.volume).sum()
    }

    /// Part that the count is off by.
    fn miss(&self, wanted: usize) -> f64 {
        (self.raw.tets.len() as f64 / wanted as f64 - 1.0).abs()
    }

    fn has_count(&self, wanted: usize, within: f64) -> bool {
        self.miss(wanted) <= within
    }

    fn is_good(&self, fields: &LabelFields, wanted: usize) -> bool {
        fields.parts.is_empty() || (self.has_count(wanted, ACCEPTED) && self.lost.is_none())
    }
}

/// No solver takes an element without a volume, strict or not.
fn not_inverted(mesh: &TetMesh) -> Result<(), MeshError> {
    let corners = |t: usize| mesh.corners(t).map(Point::to_array);
    let bad = || (0..mesh.tets.len()).filter(|&t| d3::volume6(corners(t)) <= 0.0);
    bad().next().map_or(Ok(()), |first| Err(MeshError::Inverted { count: bad().count(), at: corners(first)[0] }))
}

/// Refuses labels without elements, surfaces that are not two-manifold, of another topology than the labels or far from
/// them, gaps that were closed, wrong volumes and bad shapes.
fn strictly(report: &MeshReport) -> Result<(), MeshError> {
    let lost = |l: &LabelReport| Some(MeshError::Lost { label: l.label, voxels: l.voxels, at: l.lost_at? });
    if let Some(error) = report.labels.iter().find_map(lost) {
        return Err(error);
    }
    let labels = report.labels.iter().map(|l| (Boundary::Label(l.label), &l.surface));
    for (surface, found) in labels.chain([(Boundary::Outer, &report.outer)]) {
        if let Some(at) = found.pinched_at {
            return Err(MeshError::Topology { surface, at });
        }
        if let Some(at) = found.differs_at {
            return Err(MeshError::Euler { surface, report: Box::new(*found), at });
        }
    }
    if let Some((label, torn)) = report.labels.iter().find_map(|l| Some((l.label, l.torn?))) {
        return Err(MeshError::Torn { label, torn });
    }
    if let Some((label, interface)) = report.far().next() {
        return Err(MeshError::Far { label, interface });
    }
    if let Some(gaps) = report.closed_gaps {
        return Err(MeshError::ClosedGaps(gaps));
    }
    if let Some(overlap) = report.overlap {
        return Err(MeshError::Overlap(overlap));
    }
    if let Some(crossing) = report.self_crossing {
        return Err(MeshError::SelfCrossing(crossing));
    }
    if let Some(l) = report.labels.iter().find(|l| l.volume_error.abs() > MOST_VOLUME_ERROR) {
        return Err(MeshError::Volume { label: l.label, error: l.volume_error });
    }
    report.bad_shapes.map_or(Ok(()), |bad| {
        let dihedral = [report.dihedral_min, report.dihedral_max];
        Err(MeshError::Shape { bad, dihedral, radius_ratio: report.radius_ratio_min })
    })
}

fn check(options: &MeshOptions) -> Result<(), MeshError> {
    if options.keep.len() > MOST_LABELS {
        return Err(MeshError::TooManyLabels(options.keep.len()));
    }
    let rule = |name, value: f64, low: f64, high: f64, rule| {
        if value >= low && value <= high { Ok(()) } else { Err(MeshError::Option { name, value, rule }) }
    };
    let (low, high) = (*ELEMENTS.start() as f64, *ELEMENTS.end() as f64);
    rule("elements", options.elements as f64, low, high, "between 500 and 20 million")?;
    for &(_, density) in &options.density {
        rule("density", density, 0.01, 100.0, "between 0.01 and 100")?;
    }
    if let Some(value) = options.path.iter().flatten().flat_map(|p| p.to_array()).find(|v| !v.is_finite()) {
        return Err(MeshError::Option { name: "a coordinate of the path", value, rule: "a finite number of mm (LPS)" });
    }
    rule("growth", options.growth, *GROWTH.start(), *GROWTH.end(), "between 0.01 and 2 mm a mm")?;
    rule("coarsest", options.coarsest, *COARSEST.start(), *COARSEST.end(), "between 1 and 64 times the finest")
}

/// The count should be met within this part; a mesh that misses it is made again,
const COUNT: f64 = 0.02;
/// and refused where it still misses by this part.
const ACCEPTED: f64 = 0.05;
/// A small mesh that misses its count is made again so often: one element more or less at its surface moves many.
const FEW: usize = 10_000;
const MORE_TRIES: usize = 4;
/// Where small pieces of more than this part of a label were given away, or labels lost, a lattice too coarse to show them is
/// made again for so many times the elements.
const LACKS: f64 = 0.02;
const FINER: f64 = 3.0;

/// Coarsens to the count and improves the shapes.
fn improved(
    cleared: Cleared<'_>,
    fields: &LabelFields,
    size: &SizeField,
    wanted: usize,
    done: &mut impl FnMut(Stage),
) -> Made {
    let (aim, blind) = (cleared.target(wanted), cleared.is_blind(fields, wanted));
    let Cleared { mut work, crumbs, bounds, finest, .. } = cleared;
    let size = &*size.with_bounds(&bounds);
    let inside = Coarse { finest, target: aim, limit: 0.9, sag: 0.0, floor: 0.36 };
    work.coarsen(size, &inside);
    if work.count() > aim {
        work.improve_worst();
        for (sag, limit) in [(0.04, 0.9), (0.1, 1.2), (0.2, 2.0)] {
            work.coarsen(size, &Coarse { sag, limit, ..inside });
        }
    }
    done(Stage::Coarsen);
    let volumes = |work: &Work<'_>| work.volumes(fields.labels.len());
    if let lost @ Some(_) = coarse::gone(&volumes(&work), work.count(), fields) {
        return Made { raw: work.into_raw(), crumbs, lost, regions: None, blind };
    }
    work.improve();
    for (sag, floor) in [(0.1, 0.3), (0.2, 0.28), (0.3, 0.26), (0.5, 0.24)] {
        if work.count() > aim {
            work.coarsen(size, &Coarse { limit: 3.0, sag, floor, ..inside });
            work.improve();
        }
    }
    let found = volumes(&work);
    work.split_far(size, finest);
    let bounds = Bounds { floor: 0.40, lift: 1.0 };
    work.round_out(fields.volumes.len(), bounds);
    work.restore_volumes(&fields.volumes, bounds);
    work.finish();
    if work.count() as f64 > (1.0 + 0.5 * COUNT) * wanted as f64 {
        // On rough surfaces these passes add more than a mesh may have: less is lost inside than by making all of it again.
        work.coarsen(size, &Coarse { target: wanted, limit: 3.0, floor: improve::GOOD, ..inside });
    }
    work.settle_volumes(&fields.volumes);
    let (count, restored) = (work.count(), volumes(&work));
    let lost = coarse::lost(&found, count, fields).or_else(|| coarse::off(&restored, count, fields));
    let mut raw = work.into_raw();
    // Changes of surfaces are checked one by one above, but not everything where three labels meet.
    repair::repair(&mut raw, fields.labels.len() as u8, 0.0, |corners, l| coarse::holds(corners, l, fields));
    Made { raw, crumbs, lost, regions: None, blind }
}

fn finish(raw: RawMesh, fields: &LabelFields) -> TetMesh {
    TetMesh {
        vertices: raw.points.into_iter().map(Point::from_array).collect(),
        tets: raw.tets,
        labels: raw.labels.into_iter().map(|l| fields.labels[usize::from(l)]).collect(),
    }
}

#[cfg(test)]
mod test_head;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod told_tests;
