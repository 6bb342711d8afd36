//! The stages from a volume in HU to a case in memory.

use crate::landmarks;
use crate::plan::{self, Planned};
use crate::{Labels, NOTICE, Observer, PrepareError, Request, Stage};
use monro_anatomy::segment::{self, Doubt, Segmentation};
use monro_anatomy::surface::{self, Surface, SurfaceOptions};
use monro_anatomy::tetra::{self, LabelReport, MeshOptions, MeshReport};
use monro_case::{Case, Confidence, DoubtfulSpot, Manifest, SCHEMA, Source};
use monro_geometry::{Patient, Point, Structure, TetMesh, TriangleMesh, Volume};
use monro_scan::Scan;

/// Everything that preparing a scan gives.
#[derive(Debug)]
pub struct Prepared {
    /// The scan as read.
    pub scan: Scan,
    /// Its labels.
    pub segmentation: Segmentation,
    /// The case.
    pub case: Case,
    /// Quality of the tetrahedra.
    pub mesh: MeshReport,
    /// Volume of each structure in ml, by label.
    pub volumes_ml: Vec<(Structure, f64)>,
}

/// Surfaces of a case.
struct Surfaces {
    skin: Surface,
    skull: TriangleMesh,
    brain: Surface,
    ventricles: Surface,
}

/// Builds a case in memory.
///
/// # Errors
/// [`PrepareError`] says which stage failed and why.
pub fn build(scan: Scan, request: &Request, observer: &dyn Observer) -> Result<Prepared, PrepareError> {
    scan.warnings.iter().chain(&scan.resampled).for_each(|text| observer.remark(text));
    let segmentation = stage(observer, Stage::Segment, || labels(&scan, &request.labels))?;
    let surfaces = stage(observer, Stage::Surfaces, || surfaces(&segmentation.labels))?;
    let planned = stage(observer, Stage::Plan, || {
        plan::plan(&scan.volume, &segmentation, [&surfaces.skin.mesh, &surfaces.skull], request)
    })?;
    let (tets, mesh) =
        stage(observer, Stage::Tetrahedra, || tetrahedra(&segmentation.labels, &planned, request.elements))?;
    let volumes_ml = volumes_ml(&segmentation.labels);
    let mut findings = findings(&scan, &segmentation, &planned, &surfaces);
    findings.extend(of_mesh(&mesh));
    for finding in findings.iter().skip(of_scan(&scan)) {
        observer.remark(finding);
    }
    let case = Case {
        manifest: manifest(&scan, &segmentation, &planned, (request.elements, findings)),
        plan: planned.plan,
        landmarks: planned.landmarks,
        skin: surfaces.skin.mesh,
        brain: surfaces.brain.mesh,
        ventricles: surfaces.ventricles.mesh,
        septa: planned.septa,
        tets,
    };
    Ok(Prepared { scan, segmentation, case, mesh, volumes_ml })
}

/// Builds a case again from its own CT and from corrected labels. Identity, source, side, the wanted number of
/// tetrahedra, what is known of the scan and of the automatic segmentation and a path that was given are those of the case; landmarks,
/// surfaces, tetrahedra and a path that was found are made anew.
///
/// # Errors
/// As [`build`].
pub fn rebuild(
    case: &Case,
    mut scan: Scan,
    labels: Volume<u16>,
    observer: &dyn Observer,
) -> Result<Prepared, PrepareError> {
    let known = &case.manifest;
    // The case's own CT shows nothing any more of how it was made.
    scan.warnings.retain(|w| !known.findings.contains(w));
    scan.warnings.splice(0..0, known.findings.iter().take(known.scan_findings).cloned());
    let request = Request {
        elements: known.elements.unwrap_or(case.tets.tets.len()),
        side: Some(case.plan.side()),
        labels: Labels::Given(labels),
        path: given_path(case),
    };
    let mut prepared = build(scan, &request, observer)?;
    let made = &mut prepared.case.manifest;
    made.pseudonym.clone_from(&known.pseudonym);
    made.source = known.source.clone();
    made.confidence.clone_from(&known.confidence);
    made.doubts.clone_from(&known.doubts);
    Ok(prepared)
}

/// The path of a case, unless it is the one between its landmarks, which was found.
fn given_path(case: &Case) -> Option<[Point<Patient>; 2]> {
    const SAME_MM: f64 = 0.01;
    let path = [case.plan.entry(), case.plan.target()];
    let found = landmarks::path(&case.landmarks, case.plan.side());
    let is_found = found.is_some_and(|found| (0..2).all(|i| found[i].distance(path[i]) < SAME_MM));
    (!is_found).then_some(path)
}

/// One stage, announced; not begun once the observer wants to stop.
fn stage<T>(
    observer: &dyn Observer,
    stage: Stage,
    work: impl FnOnce() -> Result<T, PrepareError>,
) -> Result<T, PrepareError> {
    if observer.cancelled() {
        return Err(PrepareError::Cancelled);
    }
    observer.begin(stage);
    let out = work();
    observer.end(stage);
    out
}

fn labels(scan: &Scan, from: &Labels) -> Result<Segmentation, PrepareError> {
    let labels = match from {
        Labels::Automatic => return segment::segment(&scan.volume).map_err(PrepareError::Segment),
        Labels::Known(segmentation) => return Ok(segmentation.clone()),
        Labels::Given(labels) => labels,
    };
    let known = |l: u16| u8::try_from(l).ok().filter(|l| Structure::from_label(*l).is_some());
    if let Some(bad) = labels.data().iter().find(|l| known(**l).is_none()) {
        return Err(PrepareError::UnknownLabel(*bad));
    }
    segment::from_labels(&scan.volume, labels.map(|l| known(l).unwrap_or(0))).map_err(PrepareError::Labels)
}

fn surfaces(labels: &Volume<u8>) -> Result<Surfaces, PrepareError> {
    let options = SurfaceOptions::default();
    let of = |name: &'static str, keep: &(dyn Fn(u8) -> bool + Sync)| {
        surface::label_surface(labels, keep, &options).map_err(|error| PrepareError::Surface { name, error })
    };
    let is = |test: fn(Structure) -> bool| move |l: u8| Structure::from_label(l).is_some_and(test);
    let ((skin, skull), (brain, ventricles)) = rayon::join(
        || (of("skin", &is(|s| s != Structure::Outside)), of("skull", &is(|s| s >= Structure::Skull))),
        || {
            (
                of("brain", &is(|s| s == Structure::Brain || s.is_ventricle())),
                of("ventricles", &is(Structure::is_ventricle)),
            )
        },
    );
    Ok(Surfaces { skin: skin?, skull: skull?.mesh, brain: brain?, ventricles: ventricles? })
}

/// The labels that are simulated, which of them to mesh, and which to be fine around: all that lies inside the skull.
/// The thin CSF around the brain is counted to it: it has no room for elements of its own, and the outer boundary is then
/// the smooth inside of the skull, where the mesh is held.
pub fn simulated_labels(labels: &Volume<u8>) -> (Volume<u8>, Vec<u16>, Vec<u16>) {
    let (csf, brain) = (Structure::Csf.label(), Structure::Brain.label());
    let merged = labels.map(|l| if l == csf { brain } else { l });
    let present = |s: &Structure| merged.data().contains(&s.label());
    let ventricles: Vec<u16> =
        Structure::ALL.iter().filter(|s| s.is_ventricle()).filter(|s| present(s)).map(|s| s.label().into()).collect();
    let keep = [vec![brain.into()], ventricles.clone()].concat();
    (merged, keep, ventricles)
}

fn tetrahedra(labels: &Volume<u8>, planned: &Planned, elements: usize) -> Result<(TetMesh, MeshReport), PrepareError> {
    let (merged, keep, fine) = simulated_labels(labels);
    let path = Some([planned.plan.entry(), planned.plan.target()]);
    let options = MeshOptions { path, ..MeshOptions::new(&keep, &fine, elements) };
    Ok(tetra::mesh(&merged, &options)?)
}

/// Volume of each structure but the outside, ml, by label.
pub fn volumes_ml(labels: &Volume<u8>) -> Vec<(Structure, f64)> {
    let mut counts = [0usize; 256];
    for &l in labels.data() {
        counts[usize::from(l)] += 1;
    }
    let ml = labels.grid().voxel_volume() / 1000.0;
    let of = |s: Structure| (s, counts[usize::from(s.label())] as f64 * ml);
    Structure::ALL.into_iter().skip(1).map(of).collect()
}

/// How many findings tell of the scan; they come first.
fn of_scan(scan: &Scan) -> usize {
    scan.warnings.len() + usize::from(scan.resampled.is_some())
}

fn findings(scan: &Scan, segmentation: &Segmentation, planned: &Planned, surfaces: &Surfaces) -> Vec<String> {
    let mut all: Vec<String> = scan.warnings.iter().chain(&scan.resampled).cloned().collect();
    all.extend(segmentation.findings.iter().cloned());
    all.extend(planned.findings.iter().cloned());
    if surfaces.skin.open_at_border {
        all.push(cut_skin(&segmentation.labels));
    }
    let capped = [
        (&surfaces.brain, "the brain reaches the edge of the scan and was capped flat there"),
        (&surfaces.ventricles, "the ventricles reach the edge of the scan and were capped flat there"),
    ];
    all.extend(capped.iter().filter(|(s, _)| s.open_at_border).map(|(_, said)| (*said).to_owned()));
    let named = [("skin", &surfaces.skin), ("brain", &surfaces.brain), ("ventricles", &surfaces.ventricles)];
    all.extend(named.iter().filter(|(_, s)| s.crossings > 0).map(|(name, s)| {
        format!(
            "the surface of the {name} passes through itself: {} pair(s) of triangles could not be parted",
            s.crossings
        )
    }));
    all
}

/// Where the head reaches the ends of the scan: at the neck every head does, elsewhere it is cut.
fn cut_skin(labels: &Volume<u8>) -> String {
    let (neck, cut): (Vec<_>, Vec<_>) = head_at_ends(labels).into_iter().partition(|(end, _)| *end == "inferior");
    if cut.is_empty() {
        let told = "the skin reaches the edge of the scan and was capped flat there (as at every neck)";
        return if neck.is_empty() { told.replace(" (as at every neck)", "") } else { told.into() };
    }
    let said: Vec<String> = cut.iter().map(|(end, cm2)| format!("at the {end} end over {cm2:.0} cm2")).collect();
    let neck = if neck.is_empty() { "" } else { "; at the inferior end, too, as at every neck" };
    format!("the head is cut by the edge of the scan {} and was capped flat there{neck}", said.join(", "))
}

/// The ends of the scan that the labelled head reaches over at least 1 cm2, with that area, cm2.
fn head_at_ends(labels: &Volume<u8>) -> Vec<(&'static str, f64)> {
    let grid = labels.grid();
    let (dims, spacing) = (grid.dims(), grid.spacing());
    let mut counts = [[0usize; 2]; 3];
    for (n, _) in labels.data().iter().enumerate().filter(|(_, l)| **l != 0) {
        let voxel = grid.voxel(n);
        for a in 0..3 {
            counts[a][0] += usize::from(voxel[a] == 0);
            counts[a][1] += usize::from(voxel[a] + 1 == dims[a]);
        }
    }
    let ends = (0..3).flat_map(|a| [(a, 0), (a, 1)]);
    let of = |(a, side): (usize, usize)| {
        let cm2 = counts[a][side] as f64 * grid.voxel_volume() / spacing[a] / 100.0;
        (cm2 >= 1.0).then(|| (grid.end(a, side == 1), cm2))
    };
    ends.filter_map(of).collect()
}

/// What to know of the tetrahedra: structures by their names, and of handles and pieces that there are such, not each.
fn of_mesh(mesh: &MeshReport) -> Vec<String> {
    let named = |text: &str| {
        Structure::ALL.iter().fold(text.to_owned(), |text, s| {
            text.replace(&format!("label {}", s.label()), &format!("the {} (label {})", s.words(), s.label()))
        })
    };
    let mut all: Vec<String> = mesh.remarks.iter().map(|remark| format!("tetrahedra: {}", named(remark))).collect();
    all.extend(bridges(mesh));
    all
}

/// Where surfaces have other handles or pieces than those of the labels, or the smooth labels than their voxels; of coarse
/// regions that is said anyway.
fn bridges(mesh: &MeshReport) -> Option<String> {
    let differs = |l: &LabelReport| l.surface.differs_at.or(l.torn.map(|t| t.at));
    let fine = mesh.labels.iter().filter(|_| !mesh.coarse_regions);
    let place = |[x, y, z]: [f64; 3]| format!("({x:.1}, {y:.1}, {z:.1}) mm");
    let named = |l: &LabelReport| Some((Structure::from_label(l.label)?.words(), place(differs(l)?)));
    let places: Vec<String> = fine.filter_map(named).map(|(name, at)| format!("the {name} (as at {at})")).collect();
    let held = mesh.labels.iter().all(|l| l.volume_error.abs() < tetra::MOST_VOLUME_ERROR);
    let held = if held { "volumes hold, and " } else { "" };
    (!places.is_empty()).then(|| {
        format!(
            "tetrahedra: thin bridges or gaps of {} are joined or parted otherwise than in the labels; {held}only a path \
             through such a place would notice",
            places.join(" and ")
        )
    })
}

/// Short description of a series: its hashed id and description, where it has them.
fn series(source: &monro_scan::Source) -> String {
    let parts = [Some(source.series.as_str()), source.description.as_deref(), source.kernel.as_deref()];
    parts.into_iter().flatten().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Expected Dice by structure, as a manifest keeps it.
pub fn confidence(of: &[(Structure, f64)]) -> Vec<Confidence> {
    of.iter().map(|(s, dice)| Confidence { structure: s.name().into(), expected_dice: *dice }).collect()
}

/// Doubtful spots, as a manifest keeps them.
pub fn spots(segmentation: &Segmentation) -> Vec<DoubtfulSpot> {
    let spot =
        |d: &Doubt| DoubtfulSpot { structure: d.structure.name().into(), at_mm: d.at.to_array(), area_mm2: d.mm2 };
    segmentation.doubts.iter().map(spot).collect()
}

fn manifest(
    scan: &Scan,
    segmentation: &Segmentation,
    planned: &Planned,
    (elements, findings): (usize, Vec<String>),
) -> Manifest {
    let grid = scan.volume.grid();
    Manifest {
        schema: SCHEMA,
        generator: concat!("monro ", env!("CARGO_PKG_VERSION")).into(),
        notice: NOTICE.into(),
        pseudonym: scan.pseudonym.clone(),
        side: planned.plan.side().name().into(),
        skull_angle_deg: planned.skull_angle_deg,
        source: Source {
            format: scan.source.format.name().into(),
            series: series(&scan.source),
            dims: grid.dims(),
            spacing_mm: grid.spacing(),
        },
        findings,
        scan_findings: of_scan(scan),
        elements: Some(elements),
        confidence: confidence(&segmentation.confidence),
        doubts: spots(segmentation),
        files: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;

    /// A box of head in a scan of 100 x 100 x 100 mm.
    fn head(low: [usize; 3], high: [usize; 3]) -> Volume<u8> {
        let grid = Grid::axis_aligned([50; 3], [2.0; 3], [0.0; 3]).expect("a grid");
        let inside = |n: usize| (0..3).all(|a| (low[a]..high[a]).contains(&grid.voxel(n)[a]));
        Volume::new(grid, (0..grid.len()).map(|n| u8::from(inside(n))).collect()).expect("values")
    }

    #[test]
    fn a_head_cut_at_its_side_was_said_to_end_as_at_every_neck() {
        let whole = cut_skin(&head([5, 5, 0], [45, 45, 45]));
        assert!(whole.contains("as at every neck") && !whole.contains("cut"), "{whole}");
        let cut = cut_skin(&head([5, 5, 0], [50, 45, 50]));
        assert!(cut.contains("at the left end over 80 cm2, at the superior end over 72 cm2"), "{cut}");
        assert!(cut.starts_with("the head is cut") && cut.contains("at the inferior end, too"), "{cut}");
    }
}
