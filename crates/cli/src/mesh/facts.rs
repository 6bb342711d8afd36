//! What is told of any mesh, made of labels or read from a file, in the same words and JSON fields.

use super::merged;
use monro_anatomy::shapes::ShapeSummary;
use monro_anatomy::tetra::SurfaceReport;
use monro_geometry::{Patient, Point, TriangleMesh};
use serde_json::{Value, json};

/// Topology of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SurfaceFacts {
    euler: i64,
    surfaces: usize,
    pub(super) closed: bool,
    pub(super) manifold: bool,
    /// A place where it is open or meets itself, LPS mm.
    pub(super) pinched_at: Option<[f64; 3]>,
}

impl From<&TriangleMesh> for SurfaceFacts {
    fn from(surface: &TriangleMesh) -> Self {
        let topology = surface.topology();
        Self {
            euler: topology.euler(),
            surfaces: topology.components,
            closed: topology.is_closed(),
            manifold: topology.is_manifold(),
            pinched_at: surface.defect().map(Point::to_array),
        }
    }
}

impl From<&SurfaceReport> for SurfaceFacts {
    fn from(s: &SurfaceReport) -> Self {
        let SurfaceReport { euler, surfaces, closed, manifold, pinched_at, .. } = *s;
        Self { euler, surfaces, closed, manifold, pinched_at }
    }
}

impl SurfaceFacts {
    pub(super) fn json(&self) -> Value {
        json!({
            "euler": self.euler,
            "surfaces": self.surfaces,
            "closed": self.closed,
            "manifold": self.manifold,
            "pinched_at": self.pinched_at,
        })
    }

    pub(super) fn words(&self) -> String {
        let closed = if self.closed { "closed" } else { "open" };
        let manifold = if self.manifold { "two-manifold" } else { "not two-manifold" };
        format!("{closed}, {manifold}, Euler number {} in {} surface(s)", self.euler, self.surfaces)
    }
}

/// Shapes of all elements.
pub(super) fn shapes_json(s: &ShapeSummary) -> Value {
    json!({
        "dihedral_min_deg": s.dihedral_min,
        "dihedral_max_deg": s.dihedral_max,
        "dihedral_p1_deg": s.dihedral_p1,
        "radius_ratio_min": s.radius_ratio_min,
        "radius_ratio_median": s.radius_ratio_median,
        "bad_shapes": s.bad.map_or(0, |bad| bad.count),
        "worst_shape_at": s.bad.map(|bad| bad.worst_at),
    })
}

/// Counts and shapes of tetrahedra.
pub(super) fn shapes_words([elements, vertices]: [usize; 2], s: &ShapeSummary) -> String {
    format!(
        "{elements} tetrahedra, {vertices} vertices, dihedral angles {:.1} to {:.1} degrees (first percentile of the smallest in each {:.1}), radius ratio at least {:.2}",
        s.dihedral_min, s.dihedral_max, s.dihedral_p1, s.radius_ratio_min
    )
}

/// A label, its elements and their volume in mm3, and its surface.
pub(super) fn label_facts(label: u16, elements: usize, volume: f64, surface: &SurfaceFacts) -> Value {
    merged(json!({ "label": label, "elements": elements, "volume_mm3": volume }), surface.json())
}

/// The lowest and highest coordinates, LPS mm; zeros where there is no point.
pub(super) fn bounds(points: &[Point<Patient>]) -> [[f64; 3]; 2] {
    monro_geometry::bounds(points.iter().map(|p| p.to_array())).unwrap_or_default()
}

/// A place in words.
pub(crate) fn place([x, y, z]: [f64; 3]) -> String {
    format!("({x:.2}, {y:.2}, {z:.2})")
}
