//! Which soft body, and what is odd about it.

use crate::args::ModeArg;
use crate::materials;
use anyhow::{Result, ensure};
use monro_geometry::PassedThrough;
use monro_session::{Materials, Mode, ModelSettings};
use monro_tissue::{PaperOptions, PhysicalOptions};
use std::path::Path;

/// As it is for a head.
pub(crate) fn of(mode: ModeArg) -> ModelSettings {
    ModelSettings::of(match mode {
        ModeArg::Paper => Mode::Paper(PaperOptions::default()),
        ModeArg::Physical => Mode::Physical(PhysicalOptions::default()),
    })
}

/// With the materials of a file, if one is given.
pub(crate) fn model(mode: ModeArg, file: Option<&Path>) -> Result<ModelSettings> {
    let mut model = of(mode);
    if let Some(file) = file {
        ensure!(mode == ModeArg::Physical, "paper mode has no moduli: --materials needs --mode physical");
        model.materials = materials::read(file)?;
    }
    Ok(model)
}

/// Young's moduli of brains that are believed, kPa: measured ones lie between 0.5 and 15.
const BRAIN_KPA: core::ops::RangeInclusive<f64> = 0.1..=50.0;

/// Poisson's ratio from which on tissue is to keep its volume.
pub(crate) const LEAST_POISSON: f64 = 0.45;
/// Membranes are thinner, mm.
const THICKEST_MM: f64 = 1.0;
/// Walls that yield at less than this force, mN, or dimple, mm, do so where the tip only grazes them: at 30 mN and at 0 mm in a
/// head, not at 60.
const GRAZES_MN: f64 = 50.0;
const GRAZES_MM: f64 = 0.5;

/// What a reader of the materials would not expect.
pub(crate) fn remarks(model: &ModelSettings) -> Vec<String> {
    if !matches!(model.mode, Mode::Physical(_)) {
        return Vec::new();
    }
    damping(model).into_iter().chain(stiffness(model)).chain(odd(model)).collect()
}

fn stiffness(model: &ModelSettings) -> Option<String> {
    let kpa = model.materials.brain.young_kpa;
    if BRAIN_KPA.contains(&kpa) {
        return None;
    }
    let unit = if kpa > *BRAIN_KPA.end() {
        format!("{kpa} Pa would be {}", kpa / 1e3)
    } else {
        format!("{kpa} MPa would be {}", kpa * 1e3)
    };
    Some(format!("The brain's young_kpa is {kpa}; measured brains have 0.5 to 15. Moduli are in kPa: {unit}."))
}

/// Values that make sense and are far from those of tissue, as of another unit.
fn odd(model: &ModelSettings) -> Vec<String> {
    let Materials { brain, ventricles, .. } = &model.materials;
    let mut out = Vec::new();
    if brain.poisson < LEAST_POISSON {
        out.push(format!(
            "The brain's poisson is {}; tissue full of water has {LEAST_POISSON} to 0.5, and with less it is compressed where it \
             should give way.",
            brain.poisson
        ));
    }
    for (name, material) in [("brain", brain), ("ventricles", ventricles)] {
        if let Some(membrane) = material.membrane.filter(|m| m.thickness_mm > THICKEST_MM) {
            out.push(format!(
                "The membrane of the {name} has a thickness_mm of {}; pia is taken for 0.02 mm.",
                membrane.thickness_mm
            ));
        }
        let bears = &material.insertion;
        if bears.puncture_force_mn < GRAZES_MN || bears.puncture_depth_mm < GRAZES_MM {
            out.push(format!(
                "The wall of the {name} yields at {} mN or a dimple of {} mm: below {GRAZES_MN} mN and {GRAZES_MM} mm a wall yields \
                 that the tip only grazes, and the structure at the tip is told wrong there.",
                bears.puncture_force_mn, bears.puncture_depth_mm
            ));
        }
    }
    if ventricles.young_kpa > brain.young_kpa {
        out.push(format!(
            "The ventricles' young_kpa is {}, above the brain's {}: fluid is to give way to tissue.",
            ventricles.young_kpa, brain.young_kpa
        ));
    }
    out
}

fn damping(model: &ModelSettings) -> Option<String> {
    let [brain, ventricles] = [model.materials.brain, model.materials.ventricles].map(|m| m.damping_s);
    let used = brain.max(ventricles);
    (brain != ventricles).then(|| {
        format!(
            "damping_s is {brain} s for the brain and {ventricles} s for the ventricles, but a soft body has one damping \
             time: the larger, {used} s, was used for both."
        )
    })
}

/// That parts of a soft body pass through each other: tissue does not feel itself, so nothing keeps them apart.
pub(crate) fn passed_through(found: &PassedThrough) -> String {
    let [x, y, z] = found.at.to_array();
    format!(
        "the surface of the tissue, or a wall between its regions, passes through itself: {} pair(s) of triangles cross that \
         do not at rest, the first at ({x:.2}, {y:.2}, {z:.2}) mm; tissue that meets itself is not modelled",
        found.pairs
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_tissue::ThinMembrane;

    /// 3000 (Pa were meant) and 30 million kPa were simulated "without trouble".
    #[test]
    fn a_modulus_that_no_brain_has_is_told_with_the_unit() {
        let remarks_at = |kpa| {
            let mut model = of(ModeArg::Physical);
            model.materials.brain.young_kpa = kpa;
            remarks(&model)
        };
        assert_eq!(remarks_at(3.0), Vec::<String>::new());
        let said = remarks_at(3000.0).concat();
        assert!(said.contains("is 3000;") && said.contains("3000 Pa would be 3."), "{said}");
        let said = remarks_at(0.003).concat();
        assert!(said.contains("0.003 MPa would be 3."), "{said}");
    }

    /// All of these were "computed without trouble, as far as the program can tell".
    #[test]
    fn values_far_from_tissue_were_taken_without_a_word() {
        type Change = fn(&mut Materials);
        let told = |change: Change| {
            let mut model = of(ModeArg::Physical);
            change(&mut model.materials);
            remarks(&model)
        };
        assert_eq!(told(|_| {}), Vec::<String>::new());
        let cases: [(Change, &str); 5] = [
            (|m| m.brain.poisson = 0.0, "poisson is 0;"),
            (
                |m| m.brain.membrane = Some(ThinMembrane { thickness_mm: 50.0, ..ThinMembrane::PIA }),
                "thickness_mm of 50;",
            ),
            (|m| m.ventricles.young_kpa = 50.0, "above the brain's 3"),
            (|m| m.brain.insertion.puncture_force_mn = 0.0, "wall of the brain yields at 0 mN"),
            (
                |m| m.ventricles.insertion.puncture_depth_mm = 0.1,
                "wall of the ventricles yields at 120 mN or a dimple of 0.1",
            ),
        ];
        for (change, words) in cases {
            let said = told(change);
            assert!(said.len() == 1 && said[0].contains(words), "{words}: {said:?}");
        }
    }
}
