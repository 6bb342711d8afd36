//! The name under which a recording knows a soft body: the mode as on the command line, and what of it is not as usual; on the
//! following lines all materials, if they are not those of a head.

use crate::args::ModeArg;
use crate::{materials, soft_body};
use anyhow::Result;
use clap::ValueEnum;
use monro_session::{Loads, Materials, Mode, ModelSettings, Skull};
use monro_tissue::{Csf, FrameSettings};

/// How a name says how it is solved, what the skull does, and which loads there are from the start.
const PREDICTED: &str = "predicted-space";
const ITERATIONS: &str = "iterations=";
const SLIDES: &str = "skull=slides";
const NO_SEPTA: &str = "no-septa";
const DRAINED: &str = "drained-ml=";
const PRESSURE: &str = "csf-kpa=";
const GRAVITY: &str = "gravity-mm-s2=";

/// The name of a soft body and of how it is solved.
pub(crate) fn name(model: &ModelSettings, frame: &FrameSettings) -> Result<String> {
    let mode = match model.mode {
        Mode::Paper(_) => ModeArg::Paper,
        Mode::Physical(_) => ModeArg::Physical,
    };
    let mut words = vec![mode.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned())];
    if frame.iterations != FrameSettings::default().iterations {
        words.push(format!("{ITERATIONS}{}", frame.iterations));
    }
    words.extend(frame.predicted_space.then(|| PREDICTED.into()));
    words.extend(model.skull.slides().then(|| SLIDES.into()));
    words.extend((model.skull == Skull::Slides { septa: false }).then(|| NO_SEPTA.into()));
    words.extend(match frame.csf {
        Csf::AtRest => None,
        Csf::Drained { ml } => Some(format!("{DRAINED}{ml}")),
        Csf::Pressure { kpa } => Some(format!("{PRESSURE}{kpa}")),
    });
    let [x, y, z] = frame.gravity_mm_s2;
    words.extend((frame.gravity_mm_s2 != [0.0; 3]).then(|| format!("{GRAVITY}{x},{y},{z}")));
    let name = words.join(" ");
    let used = &model.materials;
    Ok(if *used == Materials::HEAD { name } else { format!("{name}\n{}", materials::text(used)?) })
}

/// The soft body of such a name, and how it is solved; `None` if it is none.
pub(crate) fn known(name: &str) -> Option<(ModelSettings, FrameSettings)> {
    let (first, text) = name.split_once('\n').unwrap_or((name, ""));
    let mut words = first.split(' ');
    let mode = ModeArg::from_str(words.next()?, false).ok()?;
    let mut model = ModelSettings { materials: materials::parse(text).ok()?, ..soft_body::of(mode) };
    let mut frame = FrameSettings::default();
    words.try_for_each(|word| take(word, &mut model, &mut frame))?;
    Loads::of(&frame).check(model.mode).ok()?;
    Some((model, frame))
}

/// Takes a word of a name; `None` if it is none.
fn take(word: &str, model: &mut ModelSettings, frame: &mut FrameSettings) -> Option<()> {
    if let Some(count) = word.strip_prefix(ITERATIONS) {
        frame.iterations = count.parse().ok().filter(|&n| n > 0)?;
    } else if let Some(ml) = word.strip_prefix(DRAINED) {
        frame.csf = Csf::Drained { ml: ml.parse().ok()? };
    } else if let Some(kpa) = word.strip_prefix(PRESSURE) {
        frame.csf = Csf::Pressure { kpa: kpa.parse().ok()? };
    } else if let Some(gravity) = word.strip_prefix(GRAVITY) {
        let all: Vec<f64> = gravity.split(',').map(str::parse).collect::<Result<_, _>>().ok()?;
        frame.gravity_mm_s2 = all.try_into().ok()?;
    } else {
        match word {
            PREDICTED => frame.predicted_space = true,
            SLIDES => model.skull = Skull::Slides { septa: true },
            NO_SEPTA if model.skull.slides() => model.skull = Skull::Slides { septa: false },
            _ => return None,
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_knows_the_soft_body_by_its_name() {
        let usual = FrameSettings::default();
        for mode in [ModeArg::Paper, ModeArg::Physical].map(soft_body::of) {
            assert_eq!(known(&name(&mode, &usual).expect("name")), Some((mode, usual)));
        }
        assert_eq!(name(&soft_body::of(ModeArg::Physical), &usual).expect("name"), "physical");
        let mut stiff = soft_body::of(ModeArg::Physical);
        stiff.materials.brain.young_kpa = 7.3;
        for (iterations, predicted_space) in [(10, true), (25, false), (3, true)] {
            let frame = FrameSettings { iterations, predicted_space, ..usual };
            let name = name(&stiff, &frame).expect("name");
            assert_eq!(known(&name), Some((stiff, frame)), "{name}");
        }
        for no in ["plastic", "physical\n[brain]\nyoung = 3.0", "physical iterations=0", "paper softly", "physical "] {
            assert_eq!(known(no), None, "{no:?}");
        }
    }

    #[test]
    fn a_name_tells_skull_and_loads_to_the_last_bit() {
        let usual = FrameSettings::default();
        let third = 1.0 / 3.0;
        let loads = [Csf::AtRest, Csf::Drained { ml: -third }, Csf::Pressure { kpa: third }];
        for (csf, skull) in
            loads.into_iter().zip([Skull::Slides { septa: true }, Skull::Slides { septa: false }, Skull::Held])
        {
            let model = ModelSettings { skull, ..soft_body::of(ModeArg::Physical) };
            let frame = FrameSettings { csf, gravity_mm_s2: [-third, 9810.0, 0.0], ..usual };
            let name = name(&model, &frame).expect("name");
            assert_eq!(known(&name), Some((model, frame)), "{name}");
        }
        for no in [
            "physical no-septa",
            "physical drained-ml=many",
            "physical gravity-mm-s2=1,2",
            "physical csf-kpa=NaN",
            "paper drained-ml=3",
        ] {
            assert_eq!(known(no), None, "{no:?}");
        }
    }
}
