//! The report of a prepared case: what a person looks at before trusting it.

use crate::NOTICE;
use crate::mesh::{MeshSection, time_section};
use crate::simulate::PROJECTED;
use anyhow::Result;
use monro_case::DoubtfulSpot;
use monro_cli::picture::{
    Colour, Figure, HeadScene, Look, Orientation, Overlay, SliceRequest, SliceView, Stroke, Window, head_figure,
    sampler, slice_figure,
};
use monro_cli::report::{Finding, KeyNumber, ReportInput, Section, Severity, Table, report_html};
use monro_geometry::{Patient, Point};
use monro_prepare::Prepared;

/// Field of view and size of a slice picture.
const FIELD_MM: f64 = 230.0;
const PIXELS: usize = 420;

/// The page.
pub(crate) fn report(prepared: &Prepared, stages: &[(String, f64)]) -> Result<String> {
    let case = &prepared.case;
    let grid = prepared.scan.volume.grid();
    let ([c, r, s], [x, y, z]) = (grid.dims(), grid.spacing());
    let input = ReportInput {
        title: "Prepared case".into(),
        pseudonym: case.manifest.pseudonym.clone(),
        side: Some(case.plan.side()),
        details: vec![
            format!(
                "{}, {c} x {r} x {s} voxels of {x:.2} x {y:.2} x {z:.2} mm",
                [case.manifest.source.format.as_str(), &case.manifest.source.series].join(" ").trim_end()
            ),
            NOTICE.into(),
        ],
        key_numbers: key_numbers(prepared),
        findings: findings(prepared),
        sections: vec![
            labels_section(prepared)?,
            plan_section(prepared)?,
            mesh_section(prepared),
            time_section(stages),
        ],
        written_by: case.manifest.generator.clone(),
    };
    Ok(report_html(&input))
}

fn key_numbers(prepared: &Prepared) -> Vec<KeyNumber> {
    let case = &prepared.case;
    let ventricles: f64 = prepared.volumes_ml.iter().filter(|(s, _)| s.is_ventricle()).map(|(_, ml)| ml).sum();
    let angle = case.manifest.skull_angle_deg.map_or("unknown".into(), |a| format!("{a:.0}"));
    vec![
        KeyNumber::new("Ventricles", format!("{ventricles:.1}"), "ml"),
        KeyNumber::new("Skin to target", format!("{:.1}", case.plan.length()), "mm"),
        KeyNumber::new("Angle to the skull", angle, "degrees").noted("90 is perpendicular"),
        KeyNumber::new("Tetrahedra", case.tets.tets.len().to_string(), ""),
        KeyNumber::new("Smallest dihedral angle", format!("{:.1}", prepared.mesh.dihedral_min), "degrees"),
    ]
}

fn findings(prepared: &Prepared) -> Vec<Finding> {
    let note = |text: &String| Finding { severity: Severity::Warning, text: text.clone() };
    prepared.case.manifest.findings.iter().map(note).collect()
}

/// Outlines of the labels.
fn outlines(prepared: &Prepared) -> Vec<Overlay<'_>> {
    let labels = &prepared.segmentation.labels;
    let outline = |of: &'static [u8], colour: Colour, name: &'static str| Overlay::Labels {
        labels,
        of,
        stroke: Stroke::solid(colour, 1.2),
        name,
    };
    vec![
        outline(&[1, 2, 3, 4, 5, 6, 7], Colour::GREY, "skin"),
        outline(&[3, 4, 5, 6, 7], Colour::SKY, "inside of the skull"),
        outline(&[4, 5, 6, 7], Colour::YELLOW, "brain"),
        outline(&[5], Colour::of_label(5), "left ventricle"),
        outline(&[6], Colour::of_label(6), "right ventricle"),
        outline(&[7], Colour::of_label(7), "third ventricle"),
    ]
}

/// A slice of the CT with the outlines of the labels and the plan.
fn labelled_slice(prepared: &Prepared, view: SliceView, window: Window, title: &str) -> Result<Figure> {
    let plan = &prepared.case.plan;
    let mut overlays = outlines(prepared);
    overlays.push(Overlay::Path {
        from: plan.entry(),
        to: plan.target(),
        stroke: Stroke::dashed(Colour::PLAN, 1.6),
        name: "plan",
    });
    overlays.extend(prepared.case.septa.iter().map(|mesh| Overlay::Surface {
        mesh,
        stroke: Stroke::dashed(Colour::ORANGE, 1.2),
        name: "falx and tentorium, of an average head",
    }));
    overlays.push(Overlay::Mark { at: plan.target(), colour: Colour::PLAN, name: "target" });
    let sample = sampler(&prepared.scan.volume);
    let caption = String::new();
    let request = SliceRequest { view, sampler: &sample, window, overlays, title: title.into(), caption };
    Ok(slice_figure(&request)?)
}

fn labels_section(prepared: &Prepared) -> Result<Section> {
    let target = prepared.case.plan.target();
    let slices = Orientation::ALL
        .map(|o| labelled_slice(prepared, SliceView::standard(o, target, FIELD_MM, PIXELS), Window::BRAIN, o.name()));
    let rows = prepared.volumes_ml.iter().map(|(s, ml)| vec![s.words(), format!("{ml:.1}")]).collect();
    let mut figures: Vec<Figure> = slices.into_iter().collect::<Result<_>>()?;
    figures.extend(doubtful_slices(prepared)?);
    let confidence = prepared.case.manifest.confidence.iter();
    let doubts =
        confidence.map(|c| vec![c.structure.replace('_', " "), format!("{:.0}", c.expected_dice * 100.0)]).collect();
    let volumes = Table { caption: "Volumes".into(), head: vec!["Structure".into(), "ml".into()], rows };
    let doubts = Table {
        caption: "Confidence of the automatic segmentation (before corrections by hand): expected Dice".into(),
        head: vec!["Structure".into(), "%".into()],
        rows: doubts,
    };
    Ok(Section {
        title: "Labels".into(),
        text: vec![
            "Slices through the target; the patient's right is on the left of axial and coronal pictures.".into(),
            PROJECTED.into(),
        ],
        tables: [volumes, doubts].into_iter().filter(|t| !t.rows.is_empty()).collect(),
        figures,
    })
}

/// Slices through the places where the border of a ventricle is a guess.
fn doubtful_slices(prepared: &Prepared) -> Result<Vec<Figure>> {
    let surface_mm2 = prepared.case.ventricles.area();
    let picture = |doubt: &DoubtfulSpot| {
        let at = Point::from_array(doubt.at_mm);
        let view = SliceView::standard(Orientation::Axial, at, 0.5 * FIELD_MM, PIXELS);
        let name = doubt.structure.replace('_', " ");
        let mut overlays = outlines(prepared);
        overlays.push(Overlay::Mark { at, colour: Colour::WHITE, name: "doubt" });
        let [x, y, z] = doubt.at_mm;
        let caption = format!(
            "Doubtful: {:.0} mm2 of the border of the {name} (about {:.0} % of the surface of all ventricles), around ({x:.0}, {y:.0}, {z:.0}) mm LPS, have no edge in the \
             scan that stands out from its blur and noise. The outline may be right all the same: look along it, and \
             correct it with \"monro edit CASE\" where it is not.",
            doubt.area_mm2,
            100.0 * doubt.area_mm2 / surface_mm2
        );
        let (sample, title) = (sampler(&prepared.scan.volume), "Doubtful".into());
        let request = SliceRequest { view, sampler: &sample, window: Window::BRAIN, overlays, title, caption };
        Ok(slice_figure(&request)?)
    };
    prepared.case.manifest.doubts.iter().map(picture).collect()
}

fn plan_section(prepared: &Prepared) -> Result<Section> {
    let case = &prepared.case;
    let (entry, target) = (case.plan.entry(), case.plan.target());
    let scene = HeadScene {
        skin: Some(&case.skin),
        solids: vec![(&case.ventricles, Colour::SKY, "ventricles")],
        path: Some([entry, target]),
        caption: "Head, ventricles and planned path. From above, unlike in axial slices, the patient's right is on the right."
            .into(),
        ..HeadScene::default()
    };
    let looks = [Look::Front, if target.x > entry.x { Look::Right } else { Look::Left }, Look::Above];
    let mut figures = vec![head_figure(&scene, &looks, 340)?];
    for facing in [Orientation::Coronal, Orientation::Sagittal] {
        if let Some(view) = SliceView::along_path(entry, target, facing, FIELD_MM, PIXELS) {
            let title = format!("Plane of the path, nearly {}", view.nearest().name().to_lowercase());
            figures.push(labelled_slice(prepared, view, Window::HEAD, &title)?);
        }
    }
    let row = |name: &str, p: Point<Patient>| {
        let mut row = vec![name.to_owned()];
        row.extend(p.to_array().map(|v| format!("{v:.1}")));
        row
    };
    let mut rows = vec![row("entry", entry), row("target", target)];
    rows.extend(case.landmarks.iter().map(|l| row(&l.label, l.position)));
    let head = ["Point", "x (left) mm", "y (back) mm", "z (up) mm"].map(String::from).to_vec();
    let table = Table { caption: "Points, LPS".into(), head, rows };
    Ok(Section { title: "Plan".into(), text: Vec::new(), tables: vec![table], figures })
}

fn mesh_section(prepared: &Prepared) -> Section {
    let tets = &prepared.case.tets;
    let plan = &prepared.case.plan;
    let section = MeshSection {
        mesh: tets,
        report: &prepared.mesh,
        path: Some([plan.entry(), plan.target()]),
        cuts: Vec::new(),
        fine: "the ventricles and the path",
        structures: true,
    };
    section.section()
}
