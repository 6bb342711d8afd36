//! What pages are told of each other, and a rebuilding that fails.

use super::routes::answer;
use super::*;
use crate::lock::lock;
use monro_geometry::Grid;
use std::path::Path;
use std::time::Duration;

/// An editor of a slab of fluid in brain.
fn shared(folder: &Path, rebuild: Rebuild) -> Arc<Shared> {
    let grid = Grid::axis_aligned([40, 40, 6], [1.0; 3], [0.0; 3]).expect("grid");
    let values = (0..grid.len()).map(|n| if n % 40 < 20 { 5 } else { 32 }).collect();
    let options = EditOptions {
        ct: Volume::new(grid, values).expect("values"),
        subject: Subject { scan: "scan-1".into(), origin: "automatic".into(), known: Known::default() },
        folder: folder.join("case.edit"),
        start: Box::new(move || Ok(Start { labels: Volume::filled(grid, 4), known: Known::default() })),
        findings: Vec::new(),
        rebuild,
        listen: ([127, 0, 0, 1], 0).into(),
    };
    Arc::new(open(options).expect("opened"))
}

#[test]
fn a_wire_drawn_in_another_tab_was_not_told_and_enter_closed_what_was_not_shown() {
    let dir = tempfile::tempdir().expect("temp");
    let shared = shared(dir.path(), Box::new(|_, _, _| Err("not asked for".into())));
    let is_told = |text: &str| {
        let (said, change) = answer(&shared, 1, text);
        assert!(said["error"].is_null(), "{said}");
        change.is_some()
    };
    assert!(!is_told(r#"{"id":1,"op":"hover","axis":2,"slice":3,"at":[19,5],"time":0}"#), "nothing is drawn yet");
    assert!(is_told(r#"{"id":2,"op":"click","axis":2,"slice":3,"at":[19,5]}"#));
    assert!(!is_told(r#"{"id":3,"op":"hover","axis":2,"slice":3,"at":[19,20],"time":0.1}"#));
    assert!(is_told(r#"{"id":4,"op":"click","axis":2,"slice":3,"at":[19,20]}"#));
    assert!(is_told(r#"{"id":5,"op":"move_anchor","anchor":1,"at":[19,30]}"#));
    assert!(is_told(r#"{"id":6,"op":"undo"}"#) && is_told(r#"{"id":7,"op":"redo"}"#));
    assert!(is_told(r#"{"id":8,"op":"drop_wire"}"#));
    assert!(!is_told(r#"{"id":9,"op":"drop_wire"}"#) && !is_told(r#"{"id":10,"op":"state"}"#));
}

#[test]
fn a_rebuilding_that_panicked_was_running_for_ever() {
    let dir = tempfile::tempdir().expect("temp");
    let shared = shared(dir.path(), Box::new(|_, _, _| panic!("a fault of the mesher")));
    for _ in 0..2 {
        assert!(rebuild::start(&shared), "it can be tried again");
        let waited = std::time::Instant::now();
        while matches!(*lock(&shared.progress), Progress::Running { .. }) {
            assert!(waited.elapsed() < Duration::from_secs(20), "still running");
            std::thread::sleep(Duration::from_millis(5));
        }
        let told = lock(&shared.progress).describe(0);
        assert_eq!(told["state"], "failed");
        assert!(told["error"].as_str().is_some_and(|e| e.contains("fault of the program")), "{told}");
    }
}
