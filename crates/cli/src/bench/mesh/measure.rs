//! One mesh of one subject: seconds, memory, quality and distances.

use super::embedding;
use super::truth::Truth;
use crate::mesh::merged;
use monro_anatomy::tetra::{self, MeshOptions, MeshReport};
use monro_geometry::{Patient, Point, TetMesh, Volume};
use serde_json::{Map, Value, json};
use std::time::Instant;

/// What is meshed.
#[derive(Debug)]
pub(crate) struct Subject {
    /// A name for the rows.
    pub(crate) name: String,
    pub(crate) labels: Volume<u16>,
    pub(crate) keep: Vec<u16>,
    pub(crate) fine: Vec<u16>,
    pub(crate) path: Option<[Point<Patient>; 2]>,
    /// The analytic ventricles of a phantom.
    pub(crate) truth: Option<Truth>,
}

impl Subject {
    /// Meshes with about `elements` elements on the present thread pool; a row of numbers, or why there is no mesh. Of
    /// several repeats each stage counts with its least time. With `embed` a surface is bound to the mesh and moved too.
    pub(crate) fn measure(&self, elements: usize, repeat: usize, embed: bool) -> Value {
        let options = MeshOptions { path: self.path, ..MeshOptions::new(&self.keep, &self.fine, elements) };
        let mut least: Vec<(&'static str, [f64; 2])> = Vec::new();
        let mut last = None;
        reset_peak_memory();
        for _ in 0..repeat {
            let mut parts = Vec::new();
            let mut since = (Instant::now(), cpu_seconds());
            let made = tetra::mesh_observed(&self.labels, &options, |stage| {
                let now = (Instant::now(), cpu_seconds());
                parts.push((stage.name(), [(now.0 - since.0).as_secs_f64(), now.1 - since.1]));
                since = now;
            });
            let sum = |i: usize| parts.iter().filter(|p| p.0 != "report").map(|p| p.1[i]).sum::<f64>();
            parts.push(("without_report", [sum(0), sum(1)]));
            keep_least(&mut least, parts);
            last = Some(made);
        }
        let seconds = |i: usize| least.iter().map(|(name, s)| ((*name).to_owned(), milli(s[i]))).collect::<Map<_, _>>();
        let head = json!({
            "subject": self.name, "wanted": elements, "seconds": seconds(0), "cpu_seconds": seconds(1), "peak_memory_mib": super::peak_memory_mib(),
        });
        let body = match last {
            Some(Ok((mesh, report))) => merged(self.row(&mesh, &report, elements), self.embedding(&mesh, embed)),
            Some(Err(error)) => json!({ "error": error.to_string() }),
            None => Value::Null,
        };
        merged(head, body)
    }

    fn embedding(&self, mesh: &TetMesh, wanted: bool) -> Value {
        match wanted.then(|| embedding::measure(mesh, &self.labels, &self.keep)) {
            Some(Ok(numbers)) => json!({ "embedding": numbers }),
            Some(Err(error)) => json!({ "embedding": { "error": error.to_string() } }),
            None => Value::Null,
        }
    }

    fn row(&self, mesh: &TetMesh, report: &MeshReport, wanted: usize) -> Value {
        let worst_volume = report.labels.iter().map(|l| l.volume_error.abs()).fold(0.0, f64::max);
        let changed = report.labels.iter().filter(|l| l.surface.differs_at.is_some());
        json!({
            "elements": report.elements,
            "count_error": report.elements as f64 / wanted as f64 - 1.0,
            "dihedral_min_deg": report.dihedral_min, "dihedral_max_deg": report.dihedral_max,
            "dihedral_p1_deg": report.dihedral_p1, "radius_ratio_min": report.radius_ratio_min,
            "radius_ratio_median": report.radius_ratio_median, "core_edge_mean_mm": report.core_edge_mean,
            "path_edge_mean_mm": report.path_edge_mean,
            "worst_volume_error": worst_volume,
            "manifold": report.labels.iter().all(|l| l.surface.pinched_at.is_none()),
            "outer_manifold": report.outer.pinched_at.is_none(),
            "bad_shapes": report.bad_shapes.map_or(0, |bad| bad.count),
            "labels_of_other_topology": changed.map(|l| l.label).collect::<Vec<_>>(),
            "to_truth": self.truth.as_ref().map(|t| t.compare(mesh)),
            "labels": report.labels.iter().map(crate::mesh::label_json).collect::<Vec<_>>(),
            "remarks": report.all_remarks(),
        })
    }
}

fn keep_least(least: &mut Vec<(&'static str, [f64; 2])>, new: Vec<(&'static str, [f64; 2])>) {
    for (name, s) in new {
        match least.iter_mut().find(|p| p.0 == name) {
            Some(p) => p.1 = [p.1[0].min(s[0]), p.1[1].min(s[1])],
            None => least.push((name, s)),
        }
    }
}

fn milli(seconds: f64) -> Value {
    Value::from((seconds * 1000.0).round() / 1000.0)
}

/// Processor time of all threads so far, s.
fn cpu_seconds() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

/// Lets the system count the peak of resident memory anew, where it can (Linux).
fn reset_peak_memory() {
    // Elsewhere the peak is that of the whole process, which is an upper bound.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}
