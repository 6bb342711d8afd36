//! What looks like a mistake in a scene and is none for certain.

use monro_geometry::{TetLocator, TetMesh};
use monro_tissue::{EmbeddedRod, StaticProblem};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Entries of a case that are read, and of each of its parts.
const READ: [(&str, &[&str]); 6] = [
    ("materials", &["E", "nu", "mu", "lam", "lam_hat"]),
    ("dirichlet", &["set", "components", "value"]),
    ("body_force", &[]),
    ("pressure", &["faces", "pressure"]),
    ("contact", &["kind", "type", "shape", "rigid_sphere", "radius", "friction", "centre_start", "centre_end"]),
    ("embedded_rod", &["radius", "p0", "p1", "displacement", "coupling"]),
];

/// Entries of a scene that are read, and of a mesh of it; and those that only tell a reader something there.
const READ_OF_SCENE: [&str; 4] = ["cases", "meshes", "energy", "units"];
const TOLD_OF_SCENE: [&str; 3] = ["scene", "title", "discretisation_error_mm"];
const READ_OF_MESH: [&str; 5] = ["file", "nodes", "tets", "face_sets", "faces"];
const TOLD_OF_MESH: [&str; 2] = ["sets", "dihedral_min_max_deg"];

/// Entries that only tell a reader, or a comparison, something anywhere.
const TOLD: [&str; 8] =
    ["description", "imposed_mm", "reference", "compare_set", "rigid_body_free", "F", "note", "name"];

/// Remarks on a problem and the sets that are held in it, by entry.
pub(super) fn all(problem: &StaticProblem, sets: &[(String, Vec<u32>)]) -> Vec<String> {
    let held = !problem.supports.is_empty() || !problem.rods.is_empty();
    let loaded = !problem.pressures.is_empty() || problem.body_force_mn_mm3 != [0.0; 3];
    let loose = match problem.contacts.len() {
        n if held || loaded || n == 0 => None,
        1 => Some("nothing holds the body: a sphere by itself only pushes it along; hold a set".to_owned()),
        n => Some(format!(
            "nothing holds the body but {n} spheres, where they touch it: how it lies otherwise is chance; hold a few nodes"
        )),
    };
    loose.into_iter().chain(conflicts(problem, sets)).chain(repeated(problem)).chain(rigid(problem)).collect()
}

/// Rigid bodies that leave the tissue no room, or are one body.
fn rigid(problem: &StaticProblem) -> Vec<String> {
    let mut out = Vec::new();
    for (i, sphere) in problem.contacts.iter().enumerate() {
        for (j, rod) in problem.rods.iter().enumerate() {
            let [from, to] = rod.ends.map(|end| end + rod.displacement_mm);
            let gap = sphere.to.distance(sphere.to.nearest_on_segment(from, to)) - sphere.radius_mm - rod.radius_mm;
            if gap < 0.0 {
                out.push(format!(
                    "the sphere of \"contact\" {i} ends {:.3} mm deep in the rod of \"embedded_rod\" {j}: the tissue that goes \
                     with the rod has no room there, and no equilibrium is to be expected; end the sphere before it",
                    -gap
                ));
            }
        }
        if let Some(first) = problem.contacts[..i].iter().position(|other| other == sphere) {
            out.push(format!(
                "\"contact\" {first} and {i} are the same sphere on the same way: they share its force; remove one of them"
            ));
        }
    }
    out
}

/// Rods of which more than half is not in the body.
pub(super) fn outside(mesh: &TetMesh, problem: &StaticProblem) -> Vec<String> {
    const SAMPLES: u32 = 200;
    if problem.rods.is_empty() {
        return Vec::new();
    }
    let Ok(locator) = TetLocator::new(mesh) else { return Vec::new() };
    let told = |(i, rod): (usize, &EmbeddedRod)| {
        let [from, to] = rod.ends;
        let at = |k: u32| from.lerp(to, (f64::from(k) + 0.5) / f64::from(SAMPLES));
        let out = (0..SAMPLES).filter(|&k| locator.locate(at(k)).is_none()).count();
        let (length, share) = (from.distance(to), out as f64 / f64::from(SAMPLES));
        (share > 0.5).then(|| {
            format!(
                "of \"embedded_rod\" {i}, {:.4} of {length:.4} mm lie outside of the body and hold nothing; a scene is in metres: \
                 check its ends if that is not meant",
                share * length
            )
        })
    };
    problem.rods.iter().enumerate().filter_map(told).collect()
}

/// Bodies that lie in each other before anything moves.
pub(super) fn overlapping(mesh: &TetMesh) -> Option<String> {
    let found = TetLocator::new(mesh).ok()?.overlap()?;
    Some(format!(
        "at rest {found}; bodies do not push on each other here: part them, or give them common nodes and faces"
    ))
}

/// Entries that nothing reads, of a scene of which one mesh and one case are meant.
pub(super) fn unread(scene: &Value, mesh: &Value, case: &Value) -> Vec<String> {
    let parts: Vec<&str> = READ.map(|(name, _)| name).to_vec();
    let of_scene = unread_in("the scene", scene, (&READ_OF_SCENE, &TOLD_OF_SCENE));
    let of_mesh = unread_in("the mesh", mesh, (&READ_OF_MESH, &TOLD_OF_MESH));
    let of_case = unread_in("the case", case, (&parts, &[]));
    let mut out: Vec<String> = [of_scene, of_mesh, of_case].into_iter().flatten().collect();
    for (part, read) in READ.into_iter().filter(|(_, read)| !read.is_empty()) {
        let entries: Vec<(String, &Value)> = match &case[part] {
            Value::Array(items) => items.iter().enumerate().map(|(i, v)| (format!("{part} {i}"), v)).collect(),
            Value::Object(regions) if part == "materials" => {
                regions.iter().map(|(region, v)| (format!("{part} of region {region}"), v)).collect()
            }
            other => vec![(part.to_owned(), other)],
        };
        for (place, entry) in entries {
            out.extend(unread_in(&place, entry, (read, &[])));
            out.extend(unread_in(&place, &entry["rigid_sphere"], (read, &[])));
        }
    }
    out
}

/// Faces that several pressures act on, by the entries.
fn repeated(problem: &StaticProblem) -> Vec<String> {
    let mut on = BTreeMap::<[u32; 3], Vec<usize>>::new();
    for (i, p) in problem.pressures.iter().enumerate() {
        p.faces.iter().for_each(|f| on.entry(sorted(*f)).or_default().push(i));
    }
    let mut shared = BTreeMap::<Vec<usize>, ([u32; 3], usize)>::new();
    for (face, mut entries) in on {
        // A face that stands twice in one entry is refused by the solver.
        entries.dedup();
        if entries.len() > 1 {
            shared.entry(entries).or_insert((face, 0)).1 += 1;
        }
    }
    let told = |(entries, (face, count)): (Vec<usize>, ([u32; 3], usize))| {
        let list = entries.iter().map(usize::to_string).collect::<Vec<_>>().join(" and ");
        format!(
            "the entries {list} of \"pressure\" act on the same faces ({count} in all, the first is {face:?}): their \
             pressures add up"
        )
    };
    shared.into_iter().map(told).collect()
}

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// Entries that nothing reads and that tell a reader nothing there: most likely one is misspelt.
fn unread_in(place: &str, entry: &Value, (read, told): (&[&str], &[&str])) -> Option<String> {
    let known = |k: &str| [read, told, &TOLD].iter().any(|l| l.contains(&k)) || k.ends_with("_note");
    let keys = entry.as_object().into_iter().flat_map(Map::keys).map(String::as_str);
    let names: Vec<&str> = keys.filter(|k| !known(k)).collect();
    let told = || format!("not read in {place}: {} (read are {})", names.join(", "), read.join(", "));
    (!names.is_empty()).then(told)
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
            "the entries {a} (set \"{}\") and {b} (set \"{}\") of \"dirichlet\" give {count} components different displacements (first at node {node}); the latter counts",
            name(a),
            name(b)
        )
    };
    found.iter().map(told).collect()
}

/// Supports that leave nothing to find, or only carry the body along.
pub(super) fn nothing_to_find(nodes: usize, problem: &StaticProblem) -> Option<String> {
    let mut held = BTreeMap::<u32, [bool; 3]>::new();
    for s in &problem.supports {
        let of = held.entry(s.node).or_default();
        (0..3).for_each(|a| of[a] |= s.displacement_mm[a].is_some());
    }
    if held.len() == nodes && held.values().all(|h| *h == [true; 3]) {
        return Some(format!("all {nodes} nodes are held in all components: there is nothing to find"));
    }
    let loaded = problem.body_force_mn_mm3 != [0.0; 3] || problem.pressures.iter().any(|p| p.kpa != 0.0);
    let alone = !loaded && problem.contacts.is_empty() && problem.rods.is_empty();
    if alone && problem.supports.iter().all(|s| s.displacement_mm.iter().flatten().all(|v| *v == 0.0)) {
        return Some("nothing is moved and nothing acts: the body stays as it is, with 0 mm everywhere; give a \"value\" other than 0, a body_force, a pressure, a contact or a rod".into());
    }
    let first = problem.supports.first()?.displacement_mm;
    let same = problem.supports.iter().all(|s| s.displacement_mm == first);
    let moves = first.iter().flatten().any(|v| *v != 0.0);
    (same && moves && alone).then(|| {
        format!(
            "all that is held moves by the same {:?} mm and nothing else acts: the body is only carried along; hold another \
             set at 0 if it should deform",
            first.map(Option::unwrap_or_default)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Point, Vector};
    use monro_tissue::SphereContact;

    #[test]
    fn bodies_that_lie_in_each_other_at_rest_were_solved_without_a_word() {
        let of = |apart: f64| {
            let body = |at: f64| [[at, 0.0, 0.0], [at + 9.0, 0.0, 0.0], [at, 9.0, 0.0], [at, 0.0, 9.0]];
            let vertices = [body(0.0), body(apart)].concat().into_iter().map(Point::from_array).collect();
            overlapping(&TetMesh { vertices, tets: vec![[0, 1, 2, 3], [4, 5, 6, 7]], labels: vec![1, 1] })
        };
        assert_eq!(of(9.5), None);
        let told = of(1.0).expect("told");
        assert!(told.contains("2 element(s) lie in others") && told.contains("do not push on each other"), "{told}");
    }

    #[test]
    fn a_rod_that_ends_far_from_the_body_and_a_body_between_two_spheres_were_not_told() {
        let vertices = [[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 9.0]].map(Point::from_array).to_vec();
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![1] };
        let rod = |end: f64| EmbeddedRod {
            radius_mm: 0.5,
            ends: [Point::new(1.0, 1.0, 1.0), Point::new(1.0, 1.0, end)],
            displacement_mm: Vector::ZERO,
        };
        let told = |end: f64| outside(&mesh, &StaticProblem { rods: vec![rod(end)], ..StaticProblem::default() });
        assert_eq!(told(8.0), Vec::<String>::new());
        assert!(told(101.0)[0].contains("94.0000 of 100.0000 mm lie outside"), "{:?}", told(101.0));
        let ball = |x: f64| SphereContact {
            radius_mm: 2.0,
            friction: 0.0,
            from: Point::new(x, 0.0, 0.0),
            to: Point::new(x, 0.0, 0.0),
        };
        let between = StaticProblem { contacts: vec![ball(-2.0), ball(11.0)], ..StaticProblem::default() };
        assert!(all(&between, &[]).concat().contains("but 2 spheres"), "{:?}", all(&between, &[]));
    }

    #[test]
    fn a_sphere_driven_into_a_rod_was_only_told_not_to_converge() {
        let sphere = |depth: f64| SphereContact {
            radius_mm: 4.0,
            friction: 0.0,
            from: Point::new(0.0, 0.0, 30.0),
            to: Point::new(0.0, 0.0, 30.0 - depth),
        };
        let rod = EmbeddedRod {
            radius_mm: 1.5,
            ends: [Point::new(-10.0, 0.0, 15.0), Point::new(10.0, 0.0, 15.0)],
            displacement_mm: Vector::new(0.0, 0.0, 2.0),
        };
        let of = |contacts: &[SphereContact]| {
            rigid(&StaticProblem { contacts: contacts.to_vec(), rods: vec![rod], ..StaticProblem::default() })
        };
        // The rod ends at 17 mm, so that a sphere has 5.5 mm from there on.
        assert!(of(&[sphere(7.4)]).is_empty());
        let told = of(&[sphere(7.4), sphere(7.6)]);
        assert!(told.len() == 1 && told[0].contains("\"contact\" 1 ends 0.100 mm deep"), "{told:?}");
        let told = of(&[sphere(1.0), sphere(2.0), sphere(1.0)]);
        assert!(told.len() == 1 && told[0].contains("0 and 2 are the same"), "{told:?}");
    }
}
