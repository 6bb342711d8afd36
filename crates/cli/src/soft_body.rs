//! Which soft body: by the arguments, and by the name that a recording knows it by.

use crate::args::ModeArg;
use crate::materials;
use anyhow::{Result, ensure};
use clap::ValueEnum;
use monro_geometry::PassedThrough;
use monro_session::{Materials, Mode, ModelSettings};
use monro_tissue::{FrameSettings, PaperOptions, PhysicalOptions};
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

/// What a reader of the materials would not expect.
pub(crate) fn remarks(model: &ModelSettings) -> Vec<String> {
    if !matches!(model.mode, Mode::Physical(_)) {
        return Vec::new();
    }
    damping(model).into_iter().chain(stiffness(model)).collect()
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

/// How a name says that the predicted deformation space is used, and how many iterations.
const PREDICTED: &str = "predicted-space";
const ITERATIONS: &str = "iterations=";

/// The name under which a recording knows a soft body: the mode as on the command line and how it is solved, if not as
/// usual; on the following lines all materials, if they are not those of a head.
pub(crate) fn name(mode: ModeArg, (used, frame): (&Materials, &FrameSettings)) -> Result<String> {
    let mut name = mode.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned());
    if frame.iterations != FrameSettings::default().iterations {
        name += &format!(" {ITERATIONS}{}", frame.iterations);
    }
    if frame.predicted_space {
        name += &format!(" {PREDICTED}");
    }
    Ok(if *used == Materials::HEAD { name } else { format!("{name}\n{}", materials::text(used)?) })
}

/// The soft body of such a name, and how it is solved; `None` if it is none.
pub(crate) fn known(name: &str) -> Option<(ModelSettings, FrameSettings)> {
    let (first, text) = name.split_once('\n').unwrap_or((name, ""));
    let mut words = first.split(' ');
    let mode = ModeArg::from_str(words.next()?, false).ok()?;
    let mut frame = FrameSettings::default();
    for word in words {
        match word.strip_prefix(ITERATIONS) {
            Some(count) => frame.iterations = count.parse().ok().filter(|&n| n > 0)?,
            None if word == PREDICTED => frame.predicted_space = true,
            None => return None,
        }
    }
    Some((ModelSettings { materials: materials::parse(text).ok()?, ..of(mode) }, frame))
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn a_recording_knows_the_soft_body_by_its_name() {
        let usual = FrameSettings::default();
        for mode in [ModeArg::Paper, ModeArg::Physical] {
            assert_eq!(known(&name(mode, (&Materials::HEAD, &usual)).expect("name")), Some((of(mode), usual)));
        }
        assert_eq!(name(ModeArg::Physical, (&Materials::HEAD, &usual)).expect("name"), "physical");
        let mut stiff = of(ModeArg::Physical);
        stiff.materials.brain.young_kpa = 7.3;
        for (iterations, predicted_space) in [(10, true), (25, false), (3, true)] {
            let frame = FrameSettings { iterations, predicted_space, ..usual };
            let name = name(ModeArg::Physical, (&stiff.materials, &frame)).expect("name");
            assert_eq!(known(&name), Some((stiff, frame)), "{name}");
        }
        for no in ["plastic", "physical\n[brain]\nyoung = 3.0", "physical iterations=0", "paper softly", "physical "] {
            assert_eq!(known(no), None, "{no:?}");
        }
    }
}
