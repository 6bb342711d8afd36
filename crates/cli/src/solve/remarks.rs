//! What looks like a mistake in a scene and is none for certain.

use monro_tissue::StaticProblem;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Entries of a case that are read.
const READ: [&str; 6] = ["materials", "dirichlet", "body_force", "pressure", "contact", "embedded_rod"];

/// Entries that only tell a reader, or a comparison, something.
const TOLD: [&str; 6] = ["description", "imposed_mm", "reference", "compare_set", "rigid_body_free", "F"];

pub(super) fn all(case: &Value, problem: &StaticProblem, sets: &[(String, Vec<u32>)]) -> Vec<String> {
    let mut out = unread(case.as_object());
    out.extend(conflicts(problem, sets));
    out
}

/// Entries that nothing reads: most likely one is misspelt.
fn unread(case: Option<&Map<String, Value>>) -> Vec<String> {
    let known = |k: &str| READ.contains(&k) || TOLD.contains(&k) || k.ends_with("_note");
    let names: Vec<&str> = case.into_iter().flat_map(Map::keys).map(String::as_str).filter(|k| !known(k)).collect();
    let told = format!("not read in the case: {} (read are {})", names.join(", "), READ.join(", "));
    if names.is_empty() { Vec::new() } else { vec![told] }
}

/// Nodes that two sets hold at different places: the set that comes later in the list counts.
fn conflicts(problem: &StaticProblem, sets: &[(String, Vec<u32>)]) -> Vec<String> {
    let mut held = BTreeMap::<(u32, usize), (u32, f64)>::new();
    let mut found = BTreeMap::<(u32, u32), (u32, usize)>::new();
    for s in &problem.supports {
        for (a, v) in s.displacement_mm.iter().enumerate().filter_map(|(a, v)| Some((a, (*v)?))) {
            if let Some((before, old)) = held.insert((s.node, a), (s.set, v))
                && old != v
            {
                let pair = found.entry((before, s.set)).or_insert((s.node, 0));
                pair.1 += 1;
            }
        }
    }
    let name = |set: u32| &sets[set as usize].0;
    let told = |(&(a, b), &(node, count)): (&(u32, u32), &(u32, usize))| {
        format!(
            "the sets \"{}\" and \"{}\" give {count} components different displacements (first at node {node}); the latter counts",
            name(a),
            name(b)
        )
    };
    found.iter().map(told).collect()
}
