use super::test_head::head;
use super::*;

fn check(mesh: &TetMesh, report: &MeshReport, elements: usize) {
    mesh.validate().expect("valid");
    let miss = mesh.tets.len() as f64 / elements as f64 - 1.0;
    assert!(miss.abs() < 0.05, "{} for {elements}", mesh.tets.len());
    let whole = mesh.surface(|_| true).topology();
    assert!(whole.is_closed() && whole.is_oriented(), "{whole:?}");
    for l in &report.labels {
        assert!(l.closed, "{l:?}");
    }
}

#[test]
fn a_head_with_horns_is_meshed_to_count() {
    let labels = head([0.9; 3]);
    let mut options = MeshOptions::new(&[4, 5, 6, 7], &[5, 6, 7], 37_336);
    options.path = Some([Point::new(30.0, 40.0, 38.0), Point::new(7.0, 15.0, 10.0)]);
    let (mesh, report) = mesh(&labels, &options).expect("mesh");
    if std::env::var_os("MONRO_SHOW").is_some() {
        eprintln!("{report:#?}");
    }
    check(&mesh, &report, options.elements);
}
