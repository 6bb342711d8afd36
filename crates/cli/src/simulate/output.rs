//! Series, meshes and summary of an insertion as files.

use super::crushed::Crushed;
use super::{Run, asked, verdict, withdrawal};
use crate::NOTICE;
use anyhow::{Context, Result};
use monro_case::vtu::{self, DataArray, Kind, UnstructuredGrid};
use monro_case::{OutputKind, Staging, nothing_known, ply};
use monro_geometry::{Structure, TetMesh};
use monro_session::KPA_PER_MMHG;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use std::iter;
use std::path::Path;

/// Columns of `insertion.csv`; that of the force is named by its unit, and empty where a frame was held: nothing was felt. One
/// for each structure follows.
const CSV_HEADER: &str = "time_s,tip_x_lps_mm,tip_y_lps_mm,tip_z_lps_mm,depth_mm,distance_rigid_mm,distance_deformed_mm,entry_angle_error_deg,target_displacement_mm,whole_volume_change_percent,{force},at_tip,inverted,rollbacks,step_ms,held";

/// What the command writes.
pub(crate) const SIMULATION: OutputKind = OutputKind {
    name: "a simulation",
    marks: &["summary.json", "insertion.csv"],
    files: &[
        "summary.json",
        "insertion.csv",
        "insertion.pvd",
        "brain_deformed.ply",
        "ventricles_deformed.ply",
        "report.html",
        "frames/tets_*.vtu",
    ],
    parts: &[],
    changed: nothing_known,
};

/// Writes everything but the report.
pub(crate) fn write(done: &Run, staging: &Staging) -> Result<()> {
    staging.write("insertion.csv", csv(done).as_bytes())?;
    staging.write("brain_deformed.ply", &ply::encode(&done.brain, None))?;
    staging.write("ventricles_deformed.ply", &ply::encode(&done.ventricles, None))?;
    let frames = staging.path().join("frames");
    fs::create_dir(&frames).with_context(|| format!("cannot make {}", frames.display()))?;
    for (i, (_, mesh)) in with_rest(done).enumerate() {
        staging.write(&format!("frames/{}", snapshot_name(i)), &vtu::encode(&deformed_grid(&done.rest, mesh)))?;
    }
    staging.write("insertion.pvd", collection(done).as_bytes())?;
    staging.write("summary.json", format!("{:#}\n", summary(done)).as_bytes())?;
    Ok(())
}

/// The meshes that are written with their times, s: the head as it was before comes first.
fn with_rest(done: &Run) -> impl Iterator<Item = (f64, &TetMesh)> {
    iter::once((done.start_s(), &done.rest)).chain(done.all_snapshots().map(|s| (s.time_s, &s.mesh)))
}

fn snapshot_name(i: usize) -> String {
    format!("tets_{i:03}.vtu")
}

/// The series as one table.
fn csv(done: &Run) -> String {
    let mut out = CSV_HEADER.replace("{force}", &done.force_name());
    for s in done.volumes.structures() {
        // Writing to a String cannot fail.
        let _ = write!(out, ",{}_change_ml", s.name());
    }
    out.push('\n');
    for row in done.all_rows() {
        let f = &row.frame;
        let [x, y, z] = f.tip.to_array();
        let axial = f.axial_force_mn().map_or_else(String::new, |v| format!("{v:.3}"));
        let _ = write!(
            out,
            "{:.4},{x:.4},{y:.4},{z:.4},{:.4},{:.4},{:.4},{:.5},{:.5},{:.6},{axial},{},{},{},{:.4},{}",
            f.time_s,
            f.depth_mm,
            f.distance_rigid_mm,
            f.distance_deformed_mm,
            f.entry_angle_error.to_degrees(),
            f.target_displacement_mm,
            f.step.volume_change * 100.0,
            f.at_tip.map_or("outside", Structure::name),
            f.step.inverted,
            f.step.rollbacks,
            row.ms,
            u8::from(f.held())
        );
        for ml in &row.change_ml {
            let _ = write!(out, ",{ml:.4}");
        }
        out.push('\n');
    }
    out
}

/// The deformed mesh with the displacement of its nodes from rest.
fn deformed_grid(rest: &TetMesh, deformed: &TetMesh) -> UnstructuredGrid {
    let moved = rest.vertices.iter().zip(&deformed.vertices).map(|(a, b)| (*b - *a).to_array());
    let mut grid = UnstructuredGrid::from_mesh(deformed);
    grid.point_data.push(DataArray::vectors("displacement_mm", Kind::Float32, &moved.collect::<Vec<_>>()));
    grid
}

/// A ParaView collection: the snapshots with their times.
fn collection(done: &Run) -> String {
    let mut out =
        String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n");
    for (i, (time_s, _)) in with_rest(done).enumerate() {
        // Rounding must not make -0 of it.
        let time_s = (time_s * 1e4).round() / 1e4 + 0.0;
        let _ = writeln!(out, "<DataSet timestep=\"{time_s:.4}\" file=\"frames/{}\"/>", snapshot_name(i));
    }
    out + "</Collection>\n</VTKFile>\n"
}

/// Numbers of the insertion, as in `summary.json`.
fn summary(done: &Run) -> Value {
    let mut all = numbers(done);
    for more in [verdict::json(done), asked::json(done)] {
        if let (Value::Object(all), Value::Object(more)) = (&mut all, more) {
            all.extend(more);
        }
    }
    all
}

fn numbers(done: &Run) -> Value {
    let csf = done.csf_json();
    let last = done.last();
    json!({
        "notice": NOTICE,
        "reached_ventricle": done.csf().is_some(),
        "ends_in_ventricle": last.is_some_and(monro_session::Frame::in_ventricle),
        "csf": csf,
        "csf_pressure_change_mmhg": last.map(|f| f.step.csf_kpa / KPA_PER_MMHG),
        "csf_volume_change_ml": last.map(|f| f.step.csf_change_ml),
        "tip_error_mm": last.map(|f| f.distance_deformed_mm),
        "tip_error_rigid_mm": last.map(|f| f.distance_rigid_mm),
        "target_shift_mm": last.map(|f| f.target_displacement_mm),
        "at_tip": last.and_then(|f| f.at_tip).map(Structure::name),
        "frames": done.all_rows().count(),
        "ms_per_frame": { "median": done.ms_quantile(0.5), "p99": done.ms_quantile(0.99) },
        "max_whole_volume_change_percent": done.largest(|f| f.step.volume_change.abs() * 100.0),
        "max_target_shift_mm": done.largest(|f| f.target_displacement_mm),
        "cortex_shift_mm": done.cortex_mm,
        "gap_ml": done.gap_ml(),
        "wall_shift_mm": done.rows.last().map(|r| r.wall_mm),
        "max_wall_shift_mm": done.largest_wall_mm(),
        format!("max_{}", done.force_name()): done.largest_force(),
        "elements": done.rest.tets.len(),
        "crushed": Crushed::of(done, &done.snapshots).map(Crushed::json),
    })
}

impl Run {
    /// How far the wall of the ventricles moved at most on the way, mm.
    pub(super) fn largest_wall_mm(&self) -> f64 {
        self.rows.iter().map(|r| r.wall_mm).fold(0.0, f64::max)
    }

    /// What brain and ventricles together have less than at rest at the end, and the skull does not, ml: nothing but for rounding where
    /// it holds them.
    pub(super) fn gap_ml(&self) -> f64 {
        self.rows.last().map_or(0.0, |r| -r.change_ml.iter().sum::<f64>())
    }

    /// What each structure has less than at rest at the end, in words.
    pub(super) fn losses(&self) -> Vec<String> {
        let Some(last) = self.rows.last() else { return Vec::new() };
        let of = |(s, ml): (&Structure, &f64)| format!("{} of {}", tenths(-ml), s.words());
        self.volumes.structures().iter().zip(&last.change_ml).map(of).collect()
    }

    /// The largest force along the shaft that lasts: of the middle one of three frames, as single ones may be of a jump.
    pub(super) fn largest_force(&self) -> f64 {
        let forces: Vec<f64> = self.rows.iter().map(|r| r.frame.axial_force_mn().unwrap_or(0.0)).collect();
        largest_that_lasts(&forces)
    }

    /// The largest of a value over all frames, 0 for none.
    pub(super) fn largest(&self, of: impl Fn(&monro_session::Frame) -> f64) -> f64 {
        self.rows.iter().map(|r| of(&r.frame)).fold(0.0, f64::max)
    }

    /// When nothing had moved yet: a frame before the first one, s.
    fn start_s(&self) -> f64 {
        let time = |n: usize| self.rows.get(n).map_or(0.0, |r| r.frame.time_s);
        if self.rows.len() > 1 { 2.0 * time(0) - time(1) } else { time(0).min(0.0) }
    }

    /// Unit of the force along the shaft in names: paper mode's coefficients have none, so its forces have none either.
    pub(super) fn force_unit(&self) -> &'static str {
        if self.has_units() { "mn" } else { "no_unit" }
    }

    fn force_name(&self) -> String {
        format!("axial_force_{}", self.force_unit())
    }

    /// The moment of first CSF as JSON; null when the tip never got there.
    fn csf_json(&self) -> Value {
        match self.csf() {
            Some(f) => {
                json!({ "time_s": f.time_s, "depth_mm": f.depth_mm, "structure": f.at_tip.map(Structure::name) })
            }
            None => Value::Null,
        }
    }
}

/// The largest middle one of three values in a row, 0 for fewer.
pub(super) fn largest_that_lasts(values: &[f64]) -> f64 {
    let middle = |w: &[f64]| w[0].min(w[1]).max(w[0].max(w[1]).min(w[2]));
    values.windows(3).map(middle).fold(0.0, f64::max)
}

/// What `--json` prints: the summary and where the files are.
pub(crate) fn summary_json(done: &Run, out: &Path) -> Value {
    let mut value = summary(done);
    let path = |name: &str| out.join(name).display().to_string();
    value["outputs"] = json!({
        "folder": out.display().to_string(), "report": path("report.html"), "series": path("insertion.csv"),
        "tetrahedra": path("insertion.pvd"), "brain": path("brain_deformed.ply"),
        "ventricles": path("ventricles_deformed.ply"), "summary": path("summary.json"),
    });
    value
}

/// The summary for people.
pub(crate) fn summary_text(done: &Run, out: &Path) -> String {
    let csf = match (done.csf(), done.left_ventricle()) {
        (Some(f), None) => format!("CSF at a depth of {:.1} mm under the skin", f.depth_mm),
        (Some(f), Some(how)) => {
            format!("CSF at a depth of {:.1} mm under the skin, but none at the end ({how})", f.depth_mm)
        }
        (None, _) => "the tip never entered a ventricle".into(),
    };
    let Some((last, last_wall)) = done.rows.last().map(|r| (&r.frame, r.wall_mm)) else {
        return "nothing was simulated".into();
    };
    let mut head = vec![format!("{}; {} side", asked::headline(done), done.plan.side().name())];
    head.extend(asked::extras(done));
    head.push(match (done.reliable(), done.findings().len()) {
        (true, 0) => "computed without trouble, as far as the program can tell".into(),
        (true, remarks) => format!("computed, with {remarks} remark(s): see the warnings above and in the report"),
        (false, _) => "NOT TO BE RELIED ON, see the warnings above and in the report".into(),
    });
    if !done.of_case.is_empty() {
        head.push(format!(
            "the case itself has {} remark(s), which bear on its plan and its tissue: see the report",
            done.of_case.len()
        ));
    }
    let withdrawn = withdrawal::text(done).map_or_else(String::new, |text| format!("\n{text}"));
    format!(
        "{}\n{csf}; at the end the tip is {} mm from the target's tissue ({} mm from the planned point), in {}.\n\
         The target moved {} mm ({} mm at most on the way), the ventricles' wall up to {} mm ({} mm). {} frames, {:.2} ms each (median; p99 {:.2}).{withdrawn}\nReport: {}",
        head.join("\n"),
        small(last.distance_deformed_mm),
        small(last.distance_rigid_mm),
        last.at_tip.map_or_else(|| "no simulated tissue".into(), Structure::words),
        small(last.target_displacement_mm),
        small(done.largest(|f| f.target_displacement_mm)),
        small(last_wall),
        small(done.largest_wall_mm()),
        done.all_rows().count(),
        done.ms_quantile(0.5),
        done.ms_quantile(0.99),
        out.join("report.html").display()
    )
}

/// A number with as many digits as say something: a usual insertion moves the target by hundredths of a millimetre.
pub(super) fn small(value: f64) -> String {
    if value.abs() < 0.95 { format!("{value:.2}") } else { format!("{value:.1}") }
}

/// A number with one decimal, and no minus before a zero.
pub(super) fn tenths(value: f64) -> String {
    format!("{:.1}", (10.0 * value).round() / 10.0 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::{largest_that_lasts, tenths};

    #[test]
    fn nothing_has_no_sign() {
        assert_eq!([-0.04, 0.04, -0.0, -12.34].map(tenths), ["0.0", "0.0", "0.0", "-12.3"]);
    }

    #[test]
    fn a_force_of_a_single_frame_was_the_largest() {
        assert_eq!(largest_that_lasts(&[128.0, 128.0, -3.0, 133.0, 256.0, 54.0]), 133.0);
        assert_eq!(largest_that_lasts(&[10.0, 160.0, 150.0, 20.0]), 150.0);
        assert_eq!((largest_that_lasts(&[1.0, 2.0]), largest_that_lasts(&[-5.0; 4])), (0.0, 0.0));
    }
}
