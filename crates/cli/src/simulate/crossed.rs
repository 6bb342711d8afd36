//! Walls that pass through each other in the meshes that are written.

use super::run::Snapshot;
use crate::soft_body;
use serde_json::{Value, json};

/// That they do at the end.
pub(super) fn at_end(snapshots: &[Snapshot]) -> Option<String> {
    let found = snapshots.last()?.self_crossing?;
    Some(format!("At the end {}", soft_body::passed_through(&found)))
}

/// That they did before, the last time, and do no more at the end; `so` is what follows from it.
pub(super) fn on_the_way(snapshots: &[Snapshot], so: &str) -> Option<String> {
    let (last, before) = snapshots.split_last()?;
    let (time_s, found) = before.iter().rev().find_map(|s| Some((s.time_s, s.self_crossing?)))?;
    last.self_crossing.is_none().then(|| {
        let what = soft_body::passed_through(&found);
        format!("At {time_s:.2} s {what}; at the end none do{so}.")
    })
}

/// How many pairs of triangles cross at the end, and where the first do; null where none do.
pub(super) fn json(snapshots: &[Snapshot]) -> Value {
    let found = snapshots.last().and_then(|s| s.self_crossing);
    json!(found.map(|c| json!({ "pairs": c.pairs, "at_lps_mm": c.at.to_array() })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{PassedThrough, Point, TetMesh};

    fn run(crossed: [bool; 3]) -> Vec<Snapshot> {
        let found = PassedThrough { pairs: 7, at: Point::new(1.0, 2.0, 3.0) };
        let at = |(time_s, crossed): (f64, bool)| Snapshot {
            time_s,
            mesh: TetMesh::default(),
            self_crossing: crossed.then_some(found),
            misplaced: None,
        };
        [0.1, 0.2, 0.3].into_iter().zip(crossed).map(at).collect()
    }

    #[test]
    fn walls_through_each_other_at_the_end_are_told_with_number_and_place() {
        for way in [false, true] {
            let run = run([false, way, true]);
            let said = at_end(&run).expect("told");
            assert!(said.contains("7 pair(s)") && said.contains("(1.00, 2.00, 3.00) mm"), "{said}");
            assert_eq!((on_the_way(&run, ""), json(&run)["pairs"].as_u64()), (None, Some(7)));
        }
    }

    #[test]
    fn walls_that_have_come_apart_again_are_another_matter() {
        let run = run([true, true, false]);
        assert_eq!((at_end(&run), json(&run)), (None, Value::Null));
        assert!(
            on_the_way(&run, "")
                .is_some_and(|said| said.starts_with("At 0.20 s the surface") && said.contains("7 pair"))
        );
    }

    #[test]
    fn nothing_is_told_where_walls_stay_apart_or_nothing_was_written() {
        for snapshots in [run([false; 3]), Vec::new()] {
            assert_eq!((at_end(&snapshots), on_the_way(&snapshots, ""), json(&snapshots)), (None, None, Value::Null));
        }
    }
}
