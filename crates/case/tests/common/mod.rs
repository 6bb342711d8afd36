//! A case of a single element.

use monro_case::markups::NamedPoint;
use monro_case::{Case, Confidence, DoubtfulSpot, Manifest, SCHEMA, Source};
use monro_geometry::{Point, TetMesh, TriangleMesh};
use monro_guidance::{Plan, Side};

fn surface() -> TriangleMesh {
    let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.25, 0.25, 1.5]].map(Point::from_array).to_vec();
    TriangleMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] }
}

pub(crate) fn case() -> Case {
    let tets = TetMesh { vertices: surface().vertices, tets: vec![[0, 1, 2, 3]], labels: vec![4] };
    let source = Source { format: "NIfTI".into(), series: "test".into(), dims: [2, 2, 2], spacing_mm: [1.0; 3] };
    let manifest = Manifest {
        schema: SCHEMA,
        generator: "test".into(),
        notice: "research".into(),
        pseudonym: "P-1".into(),
        side: "left".into(),
        skull_angle_deg: Some(89.5),
        source,
        findings: vec!["vertex cut".into()],
        scan_findings: 1,
        elements: None,
        confidence: vec![Confidence { structure: "brain".into(), expected_dice: 0.93 }],
        doubts: vec![DoubtfulSpot { structure: "third_ventricle".into(), at_mm: [1.0, -2.0, 3.5], area_mm2: 42.0 }],
        files: Vec::new(),
    };
    Case {
        manifest,
        plan: Plan::new(Side::Left, Point::new(30.0, -70.0, 100.0), Point::new(5.0, -20.0, 40.0)).expect("plan"),
        landmarks: vec![NamedPoint { label: "nasion".into(), position: Point::new(0.0, -95.0, 0.0) }],
        skin: surface(),
        brain: surface(),
        ventricles: surface(),
        septa: Some(surface()),
        tets,
    }
}
