//! The stages from a volume in HU to a case in memory.

use super::plan::{self, Planned};
use super::{Request, announce};
use crate::NOTICE;
use crate::console::Console;
use anyhow::{Context, Result};
use monro_anatomy::segment::{self, Segmentation};
use monro_anatomy::surface::{self, Surface, SurfaceOptions};
use monro_anatomy::tetra::{self, MeshOptions, MeshReport};
use monro_case::{Case, Manifest, SCHEMA, Source};
use monro_geometry::{Structure, TetMesh, TriangleMesh, Volume};
use monro_scan::Scan;
use std::path::Path;

/// Everything that preparing a scan gives.
#[derive(Debug)]
pub(crate) struct Prepared {
    /// The scan as read.
    pub(crate) scan: Scan,
    /// Its labels.
    pub(crate) segmentation: Segmentation,
    /// The case.
    pub(crate) case: Case,
    /// Quality of the tetrahedra.
    pub(crate) mesh: MeshReport,
    /// Volume of each structure in ml, by label.
    pub(crate) volumes_ml: Vec<(Structure, f64)>,
}

/// Surfaces of a case.
struct Surfaces {
    skin: Surface,
    skull: TriangleMesh,
    brain: Surface,
    ventricles: Surface,
}

/// Builds a case in memory.
pub(crate) fn build(scan: Scan, request: &Request, console: &Console) -> Result<Prepared> {
    announce(&scan, console);
    let segmentation = console.stage("segment", || labels(&scan, request.labels.as_deref()))?;
    let surfaces = console.stage("surfaces", || surfaces(&segmentation.labels))?;
    let planned = console
        .stage("plan", || plan::plan(&scan.volume, &segmentation, [&surfaces.skin.mesh, &surfaces.skull], request))?;
    let (tets, mesh) = console.stage("tetrahedra", || tetrahedra(&segmentation.labels, &planned, request))?;
    let volumes_ml = volumes_ml(&segmentation.labels);
    let findings = findings(&scan, &segmentation, &planned, &surfaces);
    for finding in findings.iter().skip(scan.warnings.len() + usize::from(scan.resampled.is_some())) {
        console.warn(finding);
    }
    let case = Case {
        manifest: manifest(&scan, &planned, findings),
        plan: planned.plan,
        landmarks: planned.landmarks,
        skin: surfaces.skin.mesh,
        brain: surfaces.brain.mesh,
        ventricles: surfaces.ventricles.mesh,
        tets,
    };
    Ok(Prepared { scan, segmentation, case, mesh, volumes_ml })
}

fn labels(scan: &Scan, file: Option<&Path>) -> Result<Segmentation> {
    let Some(file) = file else {
        return segment::segment(&scan.volume).context("the automatic segmentation failed");
    };
    let labels = monro_scan::read_labels(file)?;
    let known = |l: u16| u8::try_from(l).ok().filter(|l| Structure::from_label(*l).is_some());
    if let Some(bad) = labels.data().iter().find(|l| known(**l).is_none()) {
        anyhow::bail!("{}: label {bad} is unknown; a case has 0 (outside) to 7 (third ventricle)", file.display());
    }
    let labels = labels.map(|l| known(l).unwrap_or(0));
    segment::from_labels(&scan.volume, labels)
        .with_context(|| format!("the labels of {} cannot be used", file.display()))
}

fn surfaces(labels: &Volume<u8>) -> Result<Surfaces> {
    let options = SurfaceOptions::default();
    let of = |name: &str, keep: &(dyn Fn(u8) -> bool + Sync)| {
        surface::label_surface(labels, keep, &options).with_context(|| format!("no surface of the {name}"))
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
pub(crate) fn simulated_labels(labels: &Volume<u8>) -> (Volume<u8>, Vec<u16>, Vec<u16>) {
    let (csf, brain) = (Structure::Csf.label(), Structure::Brain.label());
    let merged = labels.map(|l| if l == csf { brain } else { l });
    let present = |s: &Structure| merged.data().contains(&s.label());
    let ventricles: Vec<u16> =
        Structure::ALL.iter().filter(|s| s.is_ventricle()).filter(|s| present(s)).map(|s| s.label().into()).collect();
    let keep = [vec![brain.into()], ventricles.clone()].concat();
    (merged, keep, ventricles)
}

fn tetrahedra(labels: &Volume<u8>, planned: &Planned, request: &Request) -> Result<(TetMesh, MeshReport)> {
    let (merged, keep, fine) = simulated_labels(labels);
    let path = Some([planned.plan.entry(), planned.plan.target()]);
    let options = MeshOptions { path, ..MeshOptions::new(&keep, &fine, request.elements) };
    tetra::mesh(&merged, &options).context("the tetrahedra cannot be made")
}

fn volumes_ml(labels: &Volume<u8>) -> Vec<(Structure, f64)> {
    let mut counts = [0usize; 256];
    for &l in labels.data() {
        counts[usize::from(l)] += 1;
    }
    let ml = labels.grid().voxel_volume() / 1000.0;
    let of = |s: Structure| (s, counts[usize::from(s.label())] as f64 * ml);
    Structure::ALL.into_iter().skip(1).map(of).collect()
}

fn findings(scan: &Scan, segmentation: &Segmentation, planned: &Planned, surfaces: &Surfaces) -> Vec<String> {
    let mut all: Vec<String> = scan.warnings.iter().chain(&scan.resampled).cloned().collect();
    all.extend(segmentation.findings.iter().cloned());
    all.extend(planned.findings.iter().cloned());
    for (name, s) in [("skin", &surfaces.skin), ("brain", &surfaces.brain), ("ventricles", &surfaces.ventricles)] {
        if s.open_at_border {
            all.push(format!("the {name} reaches the edge of the scan and was capped flat there"));
        }
    }
    all
}

/// Short description of a series: its hashed id and description, where it has them.
fn series(source: &monro_scan::Source) -> String {
    let parts = [Some(source.series.as_str()), source.description.as_deref(), source.kernel.as_deref()];
    parts.into_iter().flatten().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ")
}

fn manifest(scan: &Scan, planned: &Planned, findings: Vec<String>) -> Manifest {
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
        files: Vec::new(),
    }
}
