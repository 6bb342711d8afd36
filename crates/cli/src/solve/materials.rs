//! Materials of a scene: regions by number, moduli in Pa.

use anyhow::{Context, Result, bail, ensure};
use monro_case::vtu::{self, DataArray, UnstructuredGrid};
use monro_tissue::Material;
use serde_json::Value;
use std::collections::BTreeMap;

/// Poisson's ratios that the solver takes.
const POISSON: core::ops::Range<f64> = 0.0..0.4999;

/// Young's moduli (Pa) that the solver takes.
const YOUNG_PA: core::ops::RangeInclusive<f64> = 1e-6..=1e12;

/// Young's moduli (kPa) that some material has: what is below 10 Pa was most likely meant in kPa.
const YOUNG_KPA: core::ops::RangeInclusive<f64> = 1e-2..=1e9;

/// Materials that no element is of.
pub(super) fn unused(materials: &BTreeMap<u16, Material>, labels: &[u16]) -> Option<String> {
    let unused: Vec<String> = materials.keys().filter(|r| !labels.contains(r)).map(u16::to_string).collect();
    let told = || format!("no tetrahedron is of region {}: its material counts nowhere", unused.join(", "));
    (!unused.is_empty()).then(told)
}

/// Remarks on moduli that no material has.
pub(super) fn odd(materials: &BTreeMap<u16, Material>) -> Vec<String> {
    let odd = materials.iter().filter(|(_, m)| !YOUNG_KPA.contains(&m.young_kpa));
    odd.map(|(region, m)| {
        format!(
            "Young's modulus of region {region} is {:e} Pa: tissue has some 1e2 to 1e10; moduli are in Pa, so if {} kPa \
             are meant write {}",
            m.young_kpa * 1e3,
            m.young_kpa * 1e3,
            m.young_kpa * 1e6
        )
    })
    .collect()
}

/// The materials of a case by region.
pub(super) fn read(case: &Value) -> Result<BTreeMap<u16, Material>> {
    let entries = case["materials"].as_object();
    let entries = entries.with_context(|| wanted_materials(&case["materials"]))?;
    ensure!(!entries.is_empty(), "\"materials\" is empty: each region of the mesh needs one");
    let one = |(region, m): (&String, &Value)| {
        let label = region.parse::<u16>().ok();
        // One spelling for each: of two the second would count.
        let label = label.filter(|l| l.to_string() == *region);
        let label = label.with_context(|| format!("region \"{region}\" is no plain number from 0 to 65535"))?;
        let (young, poisson) = moduli(m).with_context(|| format!("material of region {region}"))?;
        Ok((label, Material { young_kpa: young * 1e-3, poisson, ..Material::BRAIN }))
    };
    entries.iter().map(one).collect()
}

fn wanted_materials(value: &Value) -> String {
    let there = if value.is_null() { "there is no \"materials\"" } else { "\"materials\" is of another kind" };
    format!("{there}; wanted an object of materials by region, like {{\"1\": {{\"E\": 3000, \"nu\": 0.45}}}}")
}

/// Young's modulus (Pa) and Poisson's ratio.
fn moduli(m: &Value) -> Result<(f64, f64)> {
    let of = |name: &str| m[name].as_f64();
    for name in ["E", "nu", "mu", "lam", "lam_hat"] {
        let given = m.get(name).filter(|v| !v.is_number() && !v.is_null());
        ensure!(given.is_none(), "\"{name}\" is {}, wanted a number", given.unwrap_or_default());
    }
    for (name, value) in [("E", of("E")), ("mu", of("mu"))] {
        let wrong = value.filter(|v| !(v.is_finite() && *v > 0.0));
        ensure!(wrong.is_none(), "{name} is {} Pa, wanted more than 0", wrong.unwrap_or_default());
    }
    let lame = |name: &str| Some((of("mu")?, of(name)? - if name == "lam_hat" { of("mu")? } else { 0.0 }));
    let all: Vec<(f64, f64)> = ["lam", "lam_hat"].into_iter().filter_map(lame).map(from_lame).collect();
    let given = of("E").zip(of("nu")).or(all.first().copied());
    let Some((young, poisson)) = given else {
        bail!("{m} gives neither E and nu nor mu and lam (or lam_hat), as numbers in Pa");
    };
    if young.is_finite() && POISSON.contains(&poisson) {
        contradiction(&of, (young, poisson))?;
    }
    ensure!(YOUNG_PA.contains(&young), "Young's modulus is {young:e} Pa, wanted more than 0 (1e-6 to 1e12)");
    ensure!(POISSON.contains(&poisson), "Poisson's ratio is {poisson}, {}", wanted(poisson));
    Ok((young, poisson))
}

/// E and nu of Lamé's constants.
fn from_lame((mu, lam): (f64, f64)) -> (f64, f64) {
    (mu * (3.0 * lam + 2.0 * mu) / (lam + mu), lam / (2.0 * (lam + mu)))
}

/// Lamé's second constant.
fn lam((young, poisson): (f64, f64)) -> f64 {
    young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
}

/// Refuses a constant that is not what the pair that counts makes of it. Near 0.5 lam tells what nu does not; near 0 it is
/// small beside mu.
fn contradiction(of: &impl Fn(&str) -> Option<f64>, (young, poisson): (f64, f64)) -> Result<()> {
    let (mu, lam) = (young / (2.0 * (1.0 + poisson)), lam((young, poisson)));
    let pair = if of("E").is_some() && of("nu").is_some() { "E and nu" } else { "mu and lam (or lam_hat)" };
    let (least, soft) = (lam.max(mu), mu);
    let all = [
        ("E", young, young),
        ("nu", poisson, 1.0),
        ("mu", mu, soft),
        ("lam", lam, least),
        ("lam_hat", lam + mu, least),
    ];
    for (name, meant, scale) in all {
        let Some(said) = of(name) else { continue };
        ensure!(
            (said - meant).abs() < 0.01 * scale,
            "{pair} mean {name} {meant:.6}, but it also says {name} {said}: {:.3} % off; say one pair only",
            100.0 * (said - meant) / scale
        );
    }
    Ok(())
}

fn wanted(poisson: f64) -> String {
    let (low, high) = (POISSON.start, POISSON.end);
    let why = if poisson >= high {
        "at 0.5 the volume cannot change at all and its stiffness is infinite; say 0.499 for what hardly changes it"
    } else {
        "below 0 are only foams that widen when they are pulled; say 0 for what keeps its width"
    };
    format!("wanted from {low} to below {high}: {why}")
}

/// Arrays that may be meant for the regions, where the mesh has no array of that name and one material counts everywhere.
pub(super) fn unread(grid: &UnstructuredGrid) -> Option<String> {
    let is_label = |v: &f64| v.fract() == 0.0 && (0.0..65536.0).contains(v);
    let differ = |a: &&DataArray| a.components == 1 && a.values.iter().any(|v| *v != a.values[0]);
    let like = |a: &&DataArray| differ(a) && a.values.iter().all(is_label);
    let named = vtu::find(&grid.cell_data, "region").is_some();
    let names: Vec<&str> = grid.cell_data.iter().filter(|_| !named).filter(like).map(|a| a.name.as_str()).collect();
    let told = || {
        format!(
            "the mesh has no cell array \"region\", so its one material counts everywhere; not read: {} (call it \"region\" if \
             it tells the regions)",
            names.join(", ")
        )
    };
    (!names.is_empty()).then(told)
}

/// The region of each element, each with a material.
pub(super) fn regions(grid: &UnstructuredGrid, materials: &BTreeMap<u16, Material>) -> Result<Vec<u16>> {
    let names = || materials.keys().map(u16::to_string).collect::<Vec<_>>().join(", ");
    let Some(array) = vtu::find(&grid.cell_data, "region") else {
        let there: Vec<&str> = grid.cell_data.iter().map(|a| a.name.as_str()).collect();
        ensure!(
            materials.len() == 1,
            "the mesh has no cell array \"region\" (there are: {}), but the case has materials for the regions {}; name the \
             array that tells them \"region\"",
            there.join(", "),
            names()
        );
        return Ok(materials.keys().cycle().take(grid.tets.len()).copied().collect());
    };
    let one = |(tet, &v): (usize, &f64)| {
        let label = Some(v as u16).filter(|&l| f64::from(l) == v);
        label.with_context(|| format!("tetrahedron {tet} has region {v}, wanted a number from 0 to 65535"))
    };
    let labels = array.values.iter().enumerate().map(one).collect::<Result<Vec<u16>>>()?;
    if let Some(first) = labels.iter().position(|l| !materials.contains_key(l)) {
        let label = labels[first];
        bail!(
            "{} of {} tetrahedra are of region {label} (the first is {first}), but the case has materials for the \
             regions {} only; add \"{label}\" to its \"materials\"",
            labels.iter().filter(|&&l| l == label).count(),
            labels.len(),
            names()
        );
    }
    Ok(labels)
}
