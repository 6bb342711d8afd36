//! A mesh made of labels as part of a report: cuts, grading, each label against its voxels.

use monro_anatomy::tetra::{EdgeBand, LabelReport, MeshReport, SurfaceReport};
use monro_cli::picture::{ColourBy, Figure, SliceView, draw_path, mesh_cut_figure};
use monro_cli::report::{LinePlot, Section, Series, Table};
use monro_geometry::{Patient, Point, Structure, TetMesh};

/// Pixels of the cut that holds the path, and its caption.
const PIXELS: usize = 420;
const OF_PATH: &str = "Cut in the plane of the path, which ends at the cross.";

/// What the section shows.
pub(crate) struct MeshSection<'a> {
    pub(crate) mesh: &'a TetMesh,
    pub(crate) report: &'a MeshReport,
    /// The path that it is fine along: the first cut holds it.
    pub(crate) path: Option<[Point<Patient>; 2]>,
    /// Further cuts by label, each with its caption; the first of all is shown by shape, too.
    pub(crate) cuts: Vec<(SliceView, String)>,
    /// What the mesh is fine around.
    pub(crate) fine: &'a str,
    /// The labels are the structures of a case and called by their names.
    pub(crate) structures: bool,
}

impl MeshSection<'_> {
    pub(crate) fn section(&self) -> Section {
        let mesh = self.report;
        let text = format!(
            "{} elements, {} vertices; dihedral angles {:.1} to {:.1} degrees (first percentile of the smallest in each {:.1}), radius ratio at least {:.2}; mean edge {:.2} mm within 2 mm of {}{}.",
            mesh.elements,
            mesh.vertices,
            mesh.dihedral_min,
            mesh.dihedral_max,
            mesh.dihedral_p1,
            mesh.radius_ratio_min,
            mesh.core_edge_mean,
            self.fine,
            mesh.path_edge_mean
                .map_or_else(String::new, |mean| format!(", {mean:.2} mm within 2 mm of the path alone"))
        );
        Section {
            title: "Tetrahedra".into(),
            text: vec![text],
            tables: vec![self.label_table(), self.grading_table()],
            figures: self.figures(),
        }
    }

    fn figures(&self) -> Vec<Figure> {
        let by = if self.structures { ColourBy::Structure } else { ColourBy::Label };
        let cut = |view: &SliceView, by, caption: &str| mesh_cut_figure(self.mesh, view, by, caption);
        let cuts = self.cuts.iter().map(|(view, caption)| (view, caption.as_str()));
        let plane = self.path.and_then(|path| SliceView::of_path(path, &self.mesh.vertices, PIXELS));
        let mut all = Vec::new();
        for (i, (view, caption)) in plane.iter().map(|view| (view, OF_PATH)).chain(cuts).enumerate() {
            all.push(cut(view, by, caption));
            if i == 0 {
                all.push(cut(view, ColourBy::Quality, "The same cut, by shape of the elements."));
            }
        }
        if let (Some(view), Some(path)) = (plane, self.path) {
            all[..2].iter_mut().for_each(|figure| draw_path(figure, &view, path));
        }
        all.push(self.spacing());
        all
    }

    fn spacing(&self) -> Figure {
        let bands = self.report.edge_bands.iter().filter(|b| b.edges > 0);
        let points = bands.map(|b| [b.from.max(0.0), b.mean]).collect();
        let plot = LinePlot {
            caption: format!("Grading: mean edge length by distance to {}.", self.fine),
            x_label: "distance (inner end of each band), mm".into(),
            y_label: "mean edge, mm".into(),
            series: vec![Series { name: "mean edge".into(), points }],
            ..LinePlot::default()
        };
        plot.figure()
    }

    fn label_table(&self) -> Table {
        let mut labels: Vec<&LabelReport> = self.report.labels.iter().collect();
        labels.sort_by_key(|l| l.label);
        let mut rows: Vec<Vec<String>> = labels.into_iter().map(|l| self.label_row(l)).collect();
        let mut outer =
            vec!["all together".into(), self.report.elements.to_string(), "-".into(), "-".into(), "-".into()];
        outer.extend(topology(&self.report.outer));
        rows.push(outer);
        let head = [
            "Label",
            "elements",
            "volume error %",
            "surface distance mean mm",
            "max mm",
            "Euler number (voxels')",
            "surfaces (voxels')",
            "closed",
            "two-manifold",
        ];
        Table { caption: "Each label against its voxels".into(), head: head.map(String::from).to_vec(), rows }
    }

    fn label_row(&self, l: &LabelReport) -> Vec<String> {
        let mm = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.2}"));
        let mut row = vec![
            label_name(l.label, self.structures),
            l.elements.to_string(),
            format!("{:+.2}", l.volume_error * 100.0),
            mm(l.interface.map(|i| i.mean)),
            mm(l.interface.map(|i| i.max)),
        ];
        row.extend(topology(&l.surface));
        row
    }

    fn grading_table(&self) -> Table {
        let to =
            |b: &EdgeBand| if b.to.is_finite() { format!("{} to {}", b.from, b.to) } else { format!("{} on", b.from) };
        let row = |b: &EdgeBand| vec![to(b), b.elements.to_string(), b.edges.to_string(), format!("{:.2}", b.mean)];
        Table {
            caption: format!("Grading by distance to {}; the first band holds what lies inside", self.fine),
            head: ["Distance mm", "elements", "edges", "mean edge mm"].map(String::from).to_vec(),
            rows: self.report.edge_bands.iter().map(row).collect(),
        }
    }
}

/// A label by its number, or by the structure of a case that it stands for.
pub(super) fn label_name(label: u16, structures: bool) -> String {
    let known = Structure::from_label(label).filter(|_| structures);
    known.map_or_else(|| format!("label {label}"), Structure::words)
}

/// Euler number, number of surfaces, closed, two-manifold.
fn topology(s: &SurfaceReport) -> [String; 4] {
    let yes = |is: bool| if is { "yes" } else { "no" }.to_owned();
    [
        format!("{} ({})", s.euler, s.euler_labels),
        format!("{} ({})", s.surfaces, s.surfaces_labels),
        yes(s.closed),
        yes(s.manifold),
    ]
}

/// Seconds of each stage.
pub(crate) fn time_section(stages: &[(String, f64)]) -> Section {
    let rows = stages.iter().map(|(name, s)| vec![name.clone(), format!("{s:.2}")]).collect();
    let table = Table { caption: String::new(), head: vec!["Stage".into(), "seconds".into()], rows };
    Section { title: "Time".into(), tables: vec![table], ..Section::default() }
}
