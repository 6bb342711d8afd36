//! Lengths far beyond the body's own: most likely millimetres written as metres.

use anyhow::{Result, bail};
use monro_geometry::{Patient, Point, TetMesh};
use monro_tissue::{Material, StaticProblem};
use std::collections::{BTreeMap, BTreeSet};

/// What is longer than this many diagonals of the body is odd.
const ODD: f64 = 10.0;

/// What is thinner than this share of the body's diagonal cannot be told from it: meshes end at 400,000 elements.
const THIN: f64 = 1e-3;

/// Sizes of a body, mm, beyond which its mesh is odd.
const BODY_MM: core::ops::RangeInclusive<f64> = 0.1..=10_000.0;

/// A load so many times the modulus bends a body, held somewhere, by more than its own size.
const HEAVY: f64 = 20.0;

/// A remark on a body that its own weight (the body force times its length) would flatten, by its softest material.
///
/// # Errors
/// When its size is odd too: then it is the unit of the mesh, and the solver would follow it for long.
pub(super) fn weighed(
    mesh: &TetMesh,
    problem: &StaticProblem,
    materials: &BTreeMap<u16, Material>,
) -> Result<Option<String>> {
    let force = problem.body_force_mn_mm3.iter().map(|v| v * v).sum::<f64>().sqrt();
    let softest = softest_kpa(mesh, materials);
    let (diagonal, pa) = (diagonal(mesh), 1e3 * softest);
    let share = force * diagonal / softest;
    if share.is_nan() || share <= HEAVY {
        return Ok(None);
    }
    let told = format!(
        "the body force on {:.4} m of body (its diagonal) is {:.3e} Pa, {share:.0} times Young's modulus of the softest \
         material ({pa:.3e} Pa): unless its sides confine it, it would be moved by more than its own size",
        1e-3 * diagonal,
        1e3 * force * diagonal
    );
    if !BODY_MM.contains(&diagonal) {
        bail!("{told}; points of a mesh are in metres, so if they are in mm, divide them by 1000");
    }
    Ok(Some(format!("{told}; body_force is in N/m3, moduli in Pa")))
}

/// A remark on a pressure that no body bears on a part of its surface, by its softest material.
pub(super) fn pressed(mesh: &TetMesh, problem: &StaticProblem, materials: &BTreeMap<u16, Material>) -> Option<String> {
    let softest = softest_kpa(mesh, materials);
    let largest = problem.pressures.iter().map(|p| p.kpa).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    (largest.abs() > HEAVY * softest).then(|| {
        format!(
            "a pressure of {:.3e} Pa is {:.0} times Young's modulus of the softest material ({:.3e} Pa): unless it acts from \
             all sides, nothing bears it; pressures and moduli are in Pa",
            1e3 * largest,
            (largest / softest).abs(),
            1e3 * softest
        )
    })
}

/// The least Young's modulus of an element, kPa.
fn softest_kpa(mesh: &TetMesh, materials: &BTreeMap<u16, Material>) -> f64 {
    let regions: BTreeSet<u16> = mesh.labels.iter().copied().collect();
    let there = materials.iter().filter(|m| regions.contains(m.0));
    there.map(|(_, m)| m.young_kpa).fold(f64::INFINITY, f64::min)
}

/// Remarks on lengths that are odd.
///
/// # Errors
/// When parts of the body are to move apart by more than can be meant, or a sphere swallows it.
pub(super) fn check(mesh: &TetMesh, problem: &StaticProblem, sets: &[(String, Vec<u32>)]) -> Result<Vec<String>> {
    let diagonal = diagonal(mesh);
    apart(diagonal, problem, sets)?;
    swallowed(diagonal, mesh, problem)?;
    let mut out = carried(diagonal, problem, sets);
    if !BODY_MM.contains(&diagonal) {
        out.push(format!(
            "the body has a diagonal of {diagonal:.4} mm: points of a mesh are in metres; scale it if they are not"
        ));
    }
    let mut odd = |what: String, mm: f64| {
        if mm > ODD * diagonal {
            out.push(compared(&what, mm, diagonal));
        }
    };
    for (i, c) in problem.contacts.iter().enumerate() {
        odd(format!("the radius of sphere {i}"), c.radius_mm);
        odd(format!("the way of sphere {i}"), c.from.distance(c.to));
    }
    for (i, r) in problem.rods.iter().enumerate() {
        odd(format!("the radius of rod {i}"), r.radius_mm);
        odd(format!("the length of rod {i}"), r.ends[0].distance(r.ends[1]));
    }
    let radii = problem.contacts.iter().map(|c| ("sphere", c.radius_mm)).enumerate();
    for (i, (what, mm)) in radii.chain(problem.rods.iter().map(|r| ("rod", r.radius_mm)).enumerate()) {
        if mm > 0.0 && mm < THIN * diagonal {
            out.push(format!(
                "the radius of {what} {i} is {mm:.3e} mm, 1/{:.0} of the body's diagonal of {diagonal:.4} mm: no mesh is made \
                 so fine inside, and its force is that of a thicker one; a scene is in metres, so say more if it is more",
                diagonal / mm
            ));
        }
    }
    Ok(out)
}

/// Sets that the whole body follows further than it is long.
fn carried(diagonal: f64, problem: &StaticProblem, sets: &[(String, Vec<u32>)]) -> Vec<String> {
    let mut furthest = BTreeMap::<u32, f64>::new();
    for s in &problem.supports {
        let mm = s.displacement_mm.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
        furthest.entry(s.set).and_modify(|f| *f = f.max(mm)).or_insert(mm);
    }
    let odd = furthest.into_iter().filter(|(_, mm)| *mm > ODD * diagonal);
    odd.map(|(set, mm)| compared(&format!("the displacement of the set \"{}\"", sets[set as usize].0), mm, diagonal))
        .collect()
}

fn compared(what: &str, mm: f64, diagonal: f64) -> String {
    format!(
        "{what} is {} mm, {:.0} times the body's diagonal of {diagonal:.4} mm: a scene is in metres, so if millimetres \
         are meant write {}",
        rounded(mm),
        (mm / diagonal).abs(),
        rounded(mm) * 1e-6
    )
}

/// To a tenth of a micrometre.
fn rounded(mm: f64) -> f64 {
    (mm * 1e4).round() / 1e4
}

/// Refuses motions that would pull the body apart.
fn apart(diagonal: f64, problem: &StaticProblem, sets: &[(String, Vec<u32>)]) -> Result<()> {
    let held = problem.supports.iter().map(|s| (s.displacement_mm, Some(s.set)));
    let rods = problem.rods.iter().map(|r| (r.displacement_mm.to_array().map(Some), None));
    let moved: Vec<_> = held.chain(rods).collect();
    for axis in 0..3 {
        let of = |m: &([Option<f64>; 3], Option<u32>)| Some((m.0[axis]?, m.1));
        let values: Vec<(f64, Option<u32>)> = moved.iter().filter_map(of).collect();
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v.0), h.max(v.0)));
        let furthest = values.iter().max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        if let Some(&(mm, set)) = furthest.filter(|_| high - low > ODD * diagonal) {
            let name = set.map_or_else(|| "a rod".into(), |s| format!("the set \"{}\"", sets[s as usize].0));
            bail!("{}", compared(&format!("the displacement of {name} along {}", ["x", "y", "z"][axis]), mm, diagonal));
        }
    }
    Ok(())
}

/// Refuses spheres that begin further inside the body than it is long, or end so many times as far.
fn swallowed(diagonal: f64, mesh: &TetMesh, problem: &StaticProblem) -> Result<()> {
    for (i, c) in problem.contacts.iter().enumerate() {
        let depth = |at: Point<Patient>| {
            c.radius_mm - mesh.vertices.iter().map(|p| p.distance(at)).fold(f64::INFINITY, f64::min)
        };
        for (how, mm, most) in [("begins", depth(c.from), diagonal), ("ends", depth(c.to), ODD * diagonal)] {
            if mm > most {
                bail!(
                    "{}; let it come from outside",
                    compared(&format!("the depth at which sphere {i} {how} in the body"), mm, diagonal)
                );
            }
        }
    }
    Ok(())
}

/// Diagonal of the box around the body, mm.
fn diagonal(mesh: &TetMesh) -> f64 {
    let mut range = [(f64::INFINITY, f64::NEG_INFINITY); 3];
    for p in &mesh.vertices {
        range.iter_mut().zip(p.to_array()).for_each(|(r, v)| *r = (r.0.min(v), r.1.max(v)));
    }
    range.iter().map(|(low, high)| (high - low).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Vector;
    use monro_tissue::EmbeddedRod;

    /// A head in millimetres under its weight was solved for 22 s, to a displacement of 599 m.
    #[test]
    fn a_mesh_in_millimetres_under_body_force_is_refused() {
        let of = |scale: f64, newton: f64| {
            let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let vertices = corners.map(|c| Point::from_array(c.map(|v| v * scale))).to_vec();
            let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![1] };
            let problem = StaticProblem { body_force_mn_mm3: [0.0, newton * 1e-6, 0.0], ..StaticProblem::default() };
            let material = Material { young_kpa: 3.0, ..Material::BRAIN };
            // A soft material of no element counts for nothing.
            let soft = Material { young_kpa: 1e-6, ..Material::BRAIN };
            weighed(&mesh, &problem, &BTreeMap::from([(1, material), (7, soft)]))
        };
        let refused = of(100_000.0, 1000.0).expect_err("100 m").to_string();
        assert!(refused.contains("173.2051 m") || refused.contains("141.4214 m"), "{refused}");
        assert!(refused.contains("divide them by 1000"), "{refused}");
        assert!(of(100.0, 1000.0).expect("a head").is_none());
        assert!(of(100.0, 1e6).expect("odd at most").is_some_and(|r| r.contains("N/m3")));
    }

    #[test]
    fn a_rod_too_thin_for_any_mesh_is_remarked_upon_with_both_numbers() {
        let vertices = [[0.0; 3], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 20.0]].map(Point::from_array).to_vec();
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![1] };
        let ends = [Point::new(1.0, 1.0, 1.0), Point::new(4.0, 4.0, 4.0)];
        let rod = |radius_mm| EmbeddedRod { radius_mm, ends, displacement_mm: Vector::ZERO };
        let remarks = |radius_mm| {
            let problem = StaticProblem { rods: vec![rod(radius_mm)], ..StaticProblem::default() };
            check(&mesh, &problem, &[]).expect("odd at most")
        };
        assert_eq!(remarks(1.5), Vec::<String>::new());
        let told = remarks(0.001).join("");
        assert!(
            told.contains("rod 0 is 1.000e-3 mm") && told.contains("1/34641") && told.contains("34.6410 mm"),
            "{told}"
        );
    }
}
