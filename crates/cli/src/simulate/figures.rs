//! The report of an insertion: before and after in slices, the head, and plots over time.

use super::output::{small, tenths};
use super::run::Snapshot;
use super::{Run, asked, withdrawal};
use crate::NOTICE;
use anyhow::Result;
use monro_case::Case;
use monro_cli::picture::{
    Colour, ColourBy, Figure, HeadCatheter, HeadScene, Look, Orientation, Overlay, SliceRequest, SliceView, Stroke,
    Window, head_figure, mesh_cut_figure, slice_figure,
};
use monro_cli::report::{Finding, Histogram, KeyNumber, LinePlot, ReportInput, Section, Series, Severity, report_html};
use monro_geometry::{Patient, Point, Structure, Volume};
use monro_guidance::Plan;
use monro_scan::ReadOptions;
use monro_session::{DeformedSampler, Frame, Skull};
use std::iter;
use std::path::Path;

const FIELD_MM: f64 = 160.0;
const PIXELS: usize = 420;

/// Why a path may begin inside the head, or end in mid-air.
pub(crate) const PROJECTED: &str = "Axial, coronal and sagittal slices show the path as seen through them, not where it \
    crosses them; only the plane of the path holds all of it.";

/// What a hand would feel in the plot of the force: its peak comes after the line of the ventricle.
const FORCE: &str = "Force of the tissue against the advance. A line marks where the tip breaks through into the tissue \
    named, \"CSF\" where it first lies in a ventricle. The force may rise on for some millimetres beyond; its fall is what \
    a hand would feel as the pop.";

/// The CT looked up at a point of the patient.
type Sampler<'a> = dyn Fn(Point<Patient>) -> Option<f64> + Sync + 'a;

/// The page. The CT is taken from the case folder where it is there.
pub(crate) fn report(case_dir: &Path, case: &Case, done: &Run) -> Result<String> {
    let ct_path = case_dir.join("ct.nii.gz");
    let options = ReadOptions { any_size: true, ..ReadOptions::default() };
    let ct = if ct_path.is_file() { Some(monro_scan::read(&ct_path, &options)?.volume) } else { None };
    let mut sections = vec![head_section(case, done)?];
    sections.extend(ct.as_ref().map(|ct| slices_section(ct, case, done)).transpose()?);
    sections.push(mesh_section(case, done));
    sections.push(plots_section(done));
    let input = ReportInput {
        title: "Simulated insertion".into(),
        pseudonym: case.manifest.pseudonym.clone(),
        side: Some(case.plan.side()),
        details: iter::once(asked::headline(done)).chain(asked::extras(done)).chain([NOTICE.into()]).collect(),
        key_numbers: key_numbers(done),
        findings: findings(done, ct.is_some()),
        sections,
        written_by: case.manifest.generator.clone(),
    };
    Ok(report_html(&input))
}

fn key_numbers(done: &Run) -> Vec<KeyNumber> {
    let csf = done.csf().map_or("none".into(), |f| format!("{:.1}", f.depth_mm));
    let last = |of: fn(&Frame) -> f64| done.last().map_or("none".into(), |f| small(of(f)));
    let wall_mm = done.rows.last().map_or("none".into(), |r| small(r.wall_mm));
    let pull = done.withdrawal.as_ref().filter(|_| done.has_units());
    let pull = pull.map(|out| {
        KeyNumber::new("Held back by up to", format!("{:.0}", withdrawal::pull(out)), "mN").noted("as it was drawn out")
    });
    let mut out = vec![
        KeyNumber::new("CSF at a depth of", csf, "mm").noted("under the skin, along the path"),
        KeyNumber::new("Tip to target, deformed", last(|f| f.distance_deformed_mm), "mm")
            .noted("the target's tissue, where it is now"),
        KeyNumber::new("Tip to target, rigid", last(|f| f.distance_rigid_mm), "mm").noted("the planned point"),
        KeyNumber::new("Target moved", last(|f| f.target_displacement_mm), "mm")
            .noted(format!("at the end; at most {} mm on the way", small(done.largest(|f| f.target_displacement_mm)))),
        KeyNumber::new("Ventricle wall moved up to", wall_mm, "mm")
            .noted(format!("at the end; at most {} mm on the way", small(done.largest_wall_mm()))),
        KeyNumber::new("Frame", format!("{:.2}", done.ms_quantile(0.5)), "ms")
            .noted(format!("median; 99 % below {:.2} ms", done.ms_quantile(0.99))),
    ];
    out.extend((done.settings.model.skull.slides()).then(|| {
        KeyNumber::new("Surface of the brain moved up to", small(done.cortex_mm), "mm")
            .noted(format!("at the end; {} ml are left under the skull", tenths(done.gap_ml())))
    }));
    out.extend(pull);
    out
}

fn findings(done: &Run, has_ct: bool) -> Vec<Finding> {
    let mut out = done.findings();
    out.extend(
        done.of_case.iter().map(|text| Finding { severity: Severity::Note, text: format!("Of the case: {text}") }),
    );
    if !has_ct {
        let text = "The case has no CT, so there are no slices of it here.".into();
        out.push(Finding { severity: Severity::Note, text });
    }
    out
}

fn head_section(case: &Case, done: &Run) -> Result<Section> {
    let (entry, target) = (case.plan.entry(), case.plan.target());
    let tip = done.last().map_or(target, |f| f.tip);
    let scene = HeadScene {
        skin: Some(&case.skin),
        brain: Some(&done.brain),
        solids: vec![(&done.ventricles, Colour::SKY, "ventricles, deformed")],
        path: Some([entry, target]),
        catheters: catheters(case, done, tip),
        caption: "The head at the end of the insertion. From above, unlike in axial slices, the patient's right is on the right.".into(),
    };
    let looks = [Look::Front, if target.x > entry.x { Look::Right } else { Look::Left }, Look::Above];
    Ok(Section { title: "The head".into(), figures: vec![head_figure(&scene, &looks, 340)?], ..Section::default() })
}

/// That of the plan, as far as it has come, and those beside it.
fn catheters(case: &Case, done: &Run, tip: Point<Patient>) -> Vec<HeadCatheter<'static>> {
    let outer = |plan: &Plan| plan.entry() - plan.direction() * 40.0;
    let one = |plan: &Plan, tip, colour, name| HeadCatheter {
        ends: [outer(plan), tip],
        diameter: done.settings.diameter_mm,
        colour,
        name,
    };
    let own = one(&case.plan, tip, Colour::CATHETER, "catheter");
    let others = done.beside.iter().map(|plan| one(plan, plan.target(), Colour::PURPLE, "catheter beside"));
    [own].into_iter().chain(others).collect()
}

/// Before and after, in the three standard planes through the tip and in the plane of the path.
fn slices_section(ct: &Volume<i16>, case: &Case, done: &Run) -> Result<Section> {
    let rigid = |p: Point<Patient>| ct.trilinear(p);
    let sampler = match done.snapshots.last() {
        Some(end) => Some(DeformedSampler::new(&done.rest, &end.mesh)?),
        None => None,
    };
    let deformed = |p: Point<Patient>| ct.trilinear(sampler.as_ref().map_or(Some(p), |s| s.rest_position(p))?);
    let tip = done.last().map_or(case.plan.target(), |f| f.tip);
    let mut views: Vec<(String, SliceView)> =
        Orientation::ALL.map(|o| (o.name().to_owned(), SliceView::standard(o, tip, FIELD_MM, PIXELS))).to_vec();
    let along = SliceView::along_path(case.plan.entry(), case.plan.target(), Orientation::Coronal, FIELD_MM, PIXELS);
    views.extend(along.map(|v| ("Plane of the path".to_owned(), v)));
    let mut figures = Vec::new();
    for (name, view) in views {
        let before = slice(case, done, view, &rigid, false, &format!("{name}, before"))?;
        let after = slice(case, done, view, &deformed, true, &format!("{name}, after"))?;
        figures.push(Figure::beside(&[before, after], 12.0, &format!("{name}: before and at the end")));
    }
    let text = format!(
        "Right: the CT itself deformed with the tetrahedra, black where tissue has left. Dashed outlines are before, solid ones \
         after. {}",
        PROJECTED
    );
    Ok(Section { title: "Slices".into(), text: vec![text], figures, ..Section::default() })
}

fn slice(case: &Case, done: &Run, view: SliceView, sampler: &Sampler<'_>, after: bool, title: &str) -> Result<Figure> {
    let surface = |mesh, stroke, name| Overlay::Surface { mesh, stroke, name };
    let plan = &case.plan;
    let mut overlays = vec![surface(&case.skin, Stroke::solid(Colour::GREY, 1.0), "skin")];
    if after {
        overlays.push(surface(&case.ventricles, Stroke::dashed(Colour::SKY, 1.0), "ventricles before"));
        if done.settings.model.skull.slides() {
            overlays.push(surface(&case.brain, Stroke::dashed(Colour::YELLOW, 1.0), "brain before"));
        }
        overlays.push(surface(&done.brain, Stroke::solid(Colour::YELLOW, 1.0), "brain"));
        overlays.push(surface(&done.ventricles, Stroke::solid(Colour::SKY, 1.4), "ventricles after"));
        let tip = done.last().map_or(plan.target(), |f| f.tip);
        let from = plan.entry() - plan.direction() * 30.0;
        let (diameter, colour) = (done.settings.diameter_mm, Colour::CATHETER);
        overlays.push(Overlay::Catheter { from, tip, diameter, colour, name: "catheter" });
        overlays.extend(done.beside.iter().map(|other| {
            let from = other.entry() - other.direction() * 30.0;
            let (tip, colour) = (other.target(), Colour::PURPLE);
            Overlay::Catheter { from, tip, diameter, colour, name: "catheter beside" }
        }));
    } else {
        overlays.push(surface(&case.brain, Stroke::solid(Colour::YELLOW, 1.0), "brain"));
        overlays.push(surface(&case.ventricles, Stroke::solid(Colour::SKY, 1.4), "ventricles"));
        let stroke = Stroke::dashed(Colour::PLAN, 1.6);
        overlays.push(Overlay::Path { from: plan.entry(), to: plan.target(), stroke, name: "plan" });
    }
    overlays.extend(
        case.septa
            .iter()
            .filter(|_| done.has_septa())
            .map(|septa| surface(septa, Stroke::solid(Colour::ORANGE, 1.4), "falx and tentorium")),
    );
    overlays.push(Overlay::Mark { at: plan.target(), colour: Colour::PLAN, name: "planned target" });
    let (title, caption) = (title.to_owned(), String::new());
    Ok(slice_figure(&SliceRequest { view, sampler, window: Window::BRAIN, overlays, title, caption })?)
}

/// A cut through the deformed tetrahedra, coloured by how far they moved.
fn mesh_section(case: &Case, done: &Run) -> Section {
    let out = done.withdrawal.as_ref().and_then(|w| w.snapshots.last());
    let ends = [
        done.snapshots.last().map(|s| (s, "Displacement at the end, in the plane of the path.")),
        out.map(|s| (s, "Displacement after the catheter was drawn out.")),
    ];
    let figures = ends.into_iter().flatten().map(|(end, caption)| displacement(case, done, end, caption)).collect();
    Section { title: "Tissue".into(), figures, ..Section::default() }
}

fn displacement(case: &Case, done: &Run, end: &Snapshot, caption: &str) -> Figure {
    let moved: Vec<f64> = (0..done.rest.tets.len())
        .map(|t| {
            let pairs = done.rest.corners(t).into_iter().zip(end.mesh.corners(t));
            pairs.map(|(a, b)| a.distance(b)).sum::<f64>() / 4.0
        })
        .collect();
    let most = moved.iter().copied().fold(0.1, f64::max);
    let (entry, target) = (case.plan.entry(), case.plan.target());
    let view = SliceView::of_path([entry, target], &end.mesh.vertices, 520)
        .unwrap_or_else(|| SliceView::standard(Orientation::Coronal, target, FIELD_MM, 520).fitted(&end.mesh.vertices));
    let by = ColourBy::Value { values: &moved, range: [0.0, most], name: "displacement, mm" };
    mesh_cut_figure(&end.mesh, &view, by, caption)
}

fn plots_section(done: &Run) -> Section {
    let line = |name: &str, of: &dyn Fn(&Frame) -> f64| Series {
        name: name.into(),
        points: done.all_rows().map(|r| [r.frame.time_s, of(&r.frame)]).collect(),
    };
    let plot = |caption: &str, unit: &str, series: Vec<Series>| {
        let (x_label, y_label) = ("time, s".into(), unit.to_owned());
        LinePlot { caption: caption.into(), x_label, y_label, log_x: false, log_y: false, series, events: events(done) }
            .figure()
    };
    // What is no number is not drawn.
    let force = |f: &Frame| f.axial_force_mn().unwrap_or(f64::NAN);
    let force_unit = if done.has_units() { "mN" } else { "no unit (paper mode)" };
    let steps = Histogram {
        caption: "Time for a whole frame: collision, deformation, surfaces.".into(),
        label: "frame".into(),
        unit: "ms".into(),
        values: done.all_rows().map(|r| r.ms).collect(),
        log_counts: false,
    };
    let distances = vec![
        line("to the planned point (rigid)", &|f| f.distance_rigid_mm),
        line("to the target's tissue (deformed)", &|f| f.distance_deformed_mm),
    ];
    let figures = vec![
        plot("Distance from the tip to the target.", "mm", distances),
        plot("Displacement of the target's tissue.", "mm", vec![line("target", &|f| f.target_displacement_mm)]),
        plot("Depth of the tip under the skin.", "mm", vec![line("depth", &|f| f.depth_mm)]),
        plot(FORCE, force_unit, vec![line("axial force", &force)]),
        plot("Volume of brain and ventricles against rest.", "ml", volumes(done)),
        plot(
            match done.settings.model.skull {
                Skull::Held => "Volume of all together (the skull holds it, so it hardly changes).",
                Skull::Slides { .. } => "Volume of all together: what is missing is left under the skull.",
            },
            "%",
            vec![line("volume", &|f| f.step.volume_change * 100.0)],
        ),
        steps.figure(),
    ];
    Section { title: "Over time".into(), figures, ..Section::default() }
}

/// What each structure has more than at rest.
fn volumes(done: &Run) -> Vec<Series> {
    let of = |i: usize| done.all_rows().map(|r| [r.frame.time_s, r.change_ml[i]]).collect();
    let name = |s: &Structure| match s {
        Structure::Brain => "brain and the CSF around it".to_owned(),
        other => other.words(),
    };
    let structures = done.volumes.structures().iter().enumerate();
    structures.map(|(i, s)| Series { name: name(s), points: of(i) }).collect()
}

/// Punctures, the first CSF and the turn back, to be marked in the plots.
fn events(done: &Run) -> Vec<(f64, String)> {
    let name = |l: u16| Structure::from_label(l).map_or("tissue".to_owned(), Structure::words);
    let mut out = Vec::new();
    for row in &done.rows {
        out.extend(row.frame.punctures().map(|(_, _, to)| (row.frame.time_s, name(to))));
    }
    out.extend(done.csf().map(|f| (f.time_s, "CSF".to_owned())));
    let back = done.withdrawal.as_ref().and_then(|w| w.rows.first());
    out.extend(back.map(|r| (r.frame.time_s, "drawn out".to_owned())));
    out
}
