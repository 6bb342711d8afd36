//! The report of a mesh made of labels: a page to look at before the mesh is used.

use super::Input;
use super::facts::bounds;
use super::figures::{MeshSection, label_name, time_section};
use crate::NOTICE;
use monro_anatomy::tetra::MeshReport;
use monro_cli::picture::{Orientation, SliceView};
use monro_cli::report::{Finding, KeyNumber, ReportInput, Severity, report_html};
use monro_geometry::{Patient, Point, TetMesh};

/// Pixels of a cut, and what it shows over the mesh.
const PIXELS: usize = 420;
const MARGIN: f64 = 1.08;

/// The page. `source` names the labels, `stages` their seconds.
pub(super) fn page(
    source: &str,
    input: &Input,
    mesh: &TetMesh,
    report: &MeshReport,
    stages: &[(String, f64)],
) -> String {
    let grid = input.labels.grid();
    let ([c, r, s], [x, y, z]) = (grid.dims(), grid.spacing());
    let fine = fine_words(input);
    let (path, cuts, structures) = (input.path, cuts(input, mesh), input.structures);
    let section = MeshSection { mesh, report, path, cuts, fine: &fine, structures };
    let page = ReportInput {
        title: "Mesh of labels".into(),
        pseudonym: String::new(),
        side: None,
        details: vec![
            source.to_owned(),
            format!("{c} x {r} x {s} voxels of {x:.2} x {y:.2} x {z:.2} mm"),
            NOTICE.into(),
        ],
        key_numbers: vec![
            KeyNumber::new("Tetrahedra", report.elements.to_string(), ""),
            KeyNumber::new("Labels", report.labels.len().to_string(), ""),
            KeyNumber::new("Smallest dihedral angle", format!("{:.1}", report.dihedral_min), "degrees"),
            KeyNumber::new("Largest dihedral angle", format!("{:.1}", report.dihedral_max), "degrees"),
            KeyNumber::new("Smallest radius ratio", format!("{:.2}", report.radius_ratio_min), "")
                .noted("1 is regular, 0 flat"),
        ],
        findings: report
            .all_remarks()
            .into_iter()
            .map(|r| Finding { severity: Severity::Warning, text: r.clone() })
            .collect(),
        sections: vec![section.section(), time_section(stages)],
        written_by: concat!("monro ", env!("CARGO_PKG_VERSION")).into(),
    };
    report_html(&page)
}

/// What the mesh is fine around, in words.
fn fine_words(input: &Input) -> String {
    let labels: Vec<String> = input.fine.iter().map(|&l| label_name(l, input.structures)).collect();
    let path = if input.path.is_some() { " and the path" } else { "" };
    match labels.len() {
        0 => "the path".into(),
        // A list of sixty numbers under each plot says nothing.
        n if n == input.keep.len() && n > 1 => format!("all labels{path}"),
        1..=8 => format!("{}{path}", labels.join(", ")),
        n => format!("{n} labels{path}"),
    }
}

/// Cuts of the whole mesh in all three directions, through the target of the path, else the middle of what is fine.
fn cuts(input: &Input, mesh: &TetMesh) -> Vec<(SliceView, String)> {
    let middle = |[low, high]: [[f64; 3]; 2]| Point::from_array(low).lerp(Point::from_array(high), 0.5);
    let of_fine: Vec<Point<Patient>> = mesh
        .tets
        .iter()
        .zip(&mesh.labels)
        .filter(|(_, l)| input.fine.contains(l))
        .flat_map(|(t, _)| t.map(|v| mesh.vertices[v as usize]))
        .collect();
    let whole = bounds(&mesh.vertices);
    let (at, what) = match (input.path, of_fine.is_empty()) {
        (Some([_, target]), _) => (target, "the target of the path"),
        (None, false) => (middle(bounds(&of_fine)), "the middle of what is fine"),
        (None, true) => (middle(whole), "the middle"),
    };
    let field = MARGIN * (0..3).map(|a| whole[1][a] - whole[0][a]).fold(f64::MIN_POSITIVE, f64::max);
    let centre = middle(whole);
    let cut = |orientation: Orientation| {
        let mut through = centre;
        match orientation {
            Orientation::Axial => through.z = at.z,
            Orientation::Coronal => through.y = at.y,
            Orientation::Sagittal => through.x = at.x,
        }
        let view = SliceView::standard(orientation, through, field, PIXELS);
        (view, format!("{} cut through {what}.", orientation.name()))
    };
    [Orientation::Coronal, Orientation::Axial, Orientation::Sagittal].map(cut).to_vec()
}
