//! Materials of a scene: regions by number, moduli in Pa.

use anyhow::{Context, Result, bail, ensure};
use monro_case::vtu::{self, UnstructuredGrid};
use monro_tissue::Material;
use serde_json::Value;
use std::collections::BTreeMap;

/// Poisson's ratios that the solver takes.
const POISSON: core::ops::Range<f64> = 0.0..0.4999;

/// Young's moduli (kPa) that some material has: what is below 10 Pa was most likely meant in kPa.
const YOUNG_KPA: core::ops::RangeInclusive<f64> = 1e-2..=1e9;

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
    let entries = case["materials"].as_object().context("no \"materials\"")?;
    let one = |(region, m): (&String, &Value)| {
        let label = region.parse::<u16>().ok();
        let label = label.with_context(|| format!("region \"{region}\" is no number from 0 to 65535"))?;
        let (young, poisson) = moduli(m).with_context(|| format!("material of region {region}"))?;
        Ok((label, Material { young_kpa: young * 1e-3, poisson, ..Material::BRAIN }))
    };
    entries.iter().map(one).collect()
}

/// Young's modulus (Pa) and Poisson's ratio.
fn moduli(m: &Value) -> Result<(f64, f64)> {
    let of = |name: &str| m[name].as_f64();
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
    for other in all {
        ensure!(
            agree((young, poisson), other),
            "mu and lam (or lam_hat) mean E {:.6} Pa and nu {:.6}, but it also says E {young} and nu {poisson}: lam differs \
             by {:.3} %; say one pair only",
            other.0,
            other.1,
            100.0 * (lam(other) / lam((young, poisson)) - 1.0)
        );
    }
    ensure!(young.is_finite() && young > 0.0, "Young's modulus is {young} Pa, wanted more than 0");
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

/// Whether two pairs of E and nu are one material. Near 0.5 lam tells what nu does not; near 0 it is small beside mu.
fn agree(given: (f64, f64), other: (f64, f64)) -> bool {
    let mu = |(young, poisson): (f64, f64)| young / (2.0 * (1.0 + poisson));
    let apart = (mu(other) / mu(given) - 1.0).abs().max((other.1 - given.1).abs());
    let lam_apart = (lam(other) - lam(given)).abs() / lam(given).max(mu(given));
    // What no solver takes is refused for that, with a way out.
    apart < 0.01 && (lam_apart < 0.01 || !POISSON.contains(&given.1))
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

/// The region of each element, each with a material.
pub(super) fn regions(grid: &UnstructuredGrid, materials: &BTreeMap<u16, Material>) -> Result<Vec<u16>> {
    let names = || materials.keys().map(u16::to_string).collect::<Vec<_>>().join(", ");
    let Some(array) = vtu::find(&grid.cell_data, "region") else {
        ensure!(
            materials.len() == 1,
            "the mesh has no cell array \"region\", but the case has materials for the regions {}",
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
