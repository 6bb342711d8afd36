//! Materials from a file: what it does not say stays as it is. And back, whole.

use anyhow::{Context, Result, anyhow};
use monro_session::Materials;
use monro_tissue::{Insertion, Material, ThinMembrane};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::Path;

/// The file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Given {
    brain: Region,
    ventricles: Region,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Region {
    young_kpa: Option<f64>,
    poisson: Option<f64>,
    density_kg_m3: Option<f64>,
    damping_s: Option<f64>,
    insertion: Resistance,
    membrane: Wall,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Resistance {
    puncture_force_mn: Option<f64>,
    puncture_depth_mm: Option<f64>,
    cut_force_mn: Option<f64>,
    static_friction_mn_per_mm: Option<f64>,
    dynamic_friction_mn_per_mm: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Wall {
    young_kpa: Option<f64>,
    poisson: Option<f64>,
    thickness_mm: Option<f64>,
}

/// Reads a file of materials.
pub(crate) fn read(file: &Path) -> Result<Materials> {
    let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    parse(&text).with_context(|| format!("in {}", file.display()))
}

/// Reads the text of such a file.
pub(crate) fn parse(text: &str) -> Result<Materials> {
    let given: Given = toml::from_str(text)?;
    let head = Materials::HEAD;
    let all = Materials {
        brain: given.brain.over(head.brain, ThinMembrane::PIA),
        ventricles: given.ventricles.over(head.ventricles, ThinMembrane::EPENDYMA),
    };
    for (region, m) in [("brain", &all.brain), ("ventricles", &all.ventricles)] {
        m.check().map_err(|fault| anyhow!("{region}.{fault}"))?;
    }
    Ok(all)
}

impl Region {
    /// These values over those of `m`; a membrane that it has not is begun from `wall`.
    fn over(&self, m: Material, wall: ThinMembrane) -> Material {
        let (i, own) = (m.insertion, &self.insertion);
        Material {
            young_kpa: self.young_kpa.unwrap_or(m.young_kpa),
            poisson: self.poisson.unwrap_or(m.poisson),
            density_kg_m3: self.density_kg_m3.unwrap_or(m.density_kg_m3),
            damping_s: self.damping_s.unwrap_or(m.damping_s),
            insertion: Insertion {
                puncture_force_mn: own.puncture_force_mn.unwrap_or(i.puncture_force_mn),
                puncture_depth_mm: own.puncture_depth_mm.unwrap_or(i.puncture_depth_mm),
                cut_force_mn: own.cut_force_mn.unwrap_or(i.cut_force_mn),
                static_friction_mn_per_mm: own.static_friction_mn_per_mm.unwrap_or(i.static_friction_mn_per_mm),
                dynamic_friction_mn_per_mm: own.dynamic_friction_mn_per_mm.unwrap_or(i.dynamic_friction_mn_per_mm),
            },
            membrane: self.membrane.over(m.membrane, wall),
            ..m
        }
    }
}

impl Wall {
    /// A thickness of nothing is no membrane.
    fn over(&self, had: Option<ThinMembrane>, otherwise: ThinMembrane) -> Option<ThinMembrane> {
        let says = [self.young_kpa, self.poisson, self.thickness_mm].iter().any(Option::is_some);
        if !says || self.thickness_mm == Some(0.0) {
            return had.filter(|_| !says);
        }
        let m = had.unwrap_or(otherwise);
        Some(ThinMembrane {
            young_kpa: self.young_kpa.unwrap_or(m.young_kpa),
            poisson: self.poisson.unwrap_or(m.poisson),
            thickness_mm: self.thickness_mm.unwrap_or(m.thickness_mm),
        })
    }
}

/// The text of a file that says everything, from which the same bits are read.
pub(crate) fn text(used: &Materials) -> Result<String> {
    let mut all = json(used);
    for region in ["brain", "ventricles"] {
        let membrane = &mut all[region]["membrane"];
        if membrane.is_null() {
            *membrane = json!({ "thickness_mm": 0.0 });
        }
    }
    Ok(toml::to_string(&all)?)
}

/// Materials as they were used, with the names of the file.
pub(crate) fn json(used: &Materials) -> Value {
    json!({ "brain": region(&used.brain), "ventricles": region(&used.ventricles) })
}

fn region(m: &Material) -> Value {
    let i = &m.insertion;
    let membrane =
        m.membrane.map(|w| json!({ "young_kpa": w.young_kpa, "poisson": w.poisson, "thickness_mm": w.thickness_mm }));
    json!({
        "young_kpa": m.young_kpa,
        "poisson": m.poisson,
        "density_kg_m3": m.density_kg_m3,
        "damping_s": m.damping_s,
        "insertion": {
            "puncture_force_mn": i.puncture_force_mn,
            "puncture_depth_mm": i.puncture_depth_mm,
            "cut_force_mn": i.cut_force_mn,
            "static_friction_mn_per_mm": i.static_friction_mn_per_mm,
            "dynamic_friction_mn_per_mm": i.dynamic_friction_mn_per_mm,
        },
        "membrane": membrane,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(text: &str) -> Result<Materials> {
        let file = tempfile::NamedTempFile::new()?;
        std::fs::write(file.path(), text)?;
        read(file.path())
    }

    #[test]
    fn what_a_file_does_not_say_stays_as_it_is() {
        assert_eq!(said("").expect("empty"), Materials::HEAD);
        let m = said(
            "[brain]\nyoung_kpa = 1.4\n[brain.insertion]\ncut_force_mn = 30\n[ventricles.membrane]\nthickness_mm = 0.1\n",
        );
        let m = m.expect("materials");
        assert_eq!((m.brain.young_kpa, m.brain.poisson), (1.4, Material::BRAIN.poisson));
        assert_eq!(m.brain.insertion.cut_force_mn, 30.0);
        assert_eq!(m.brain.membrane, Some(ThinMembrane::PIA));
        assert_eq!(m.ventricles.membrane, Some(ThinMembrane { thickness_mm: 0.1, ..ThinMembrane::EPENDYMA }));
        assert_eq!(said("[brain.membrane]\nthickness_mm = 0.0\n").expect("none").brain.membrane, None);
    }

    #[test]
    fn what_is_written_is_read_to_the_same_bits() {
        for (n, wall) in [None, Some(1.0 / 3.0), Some(0.1 + 0.2)].into_iter().enumerate() {
            let mut used = Materials::HEAD;
            used.brain.young_kpa = 10.0 / (3.0 + n as f64);
            used.ventricles.insertion.cut_force_mn = 1e-7 * (n as f64).sqrt();
            used.brain.membrane = wall.map(|thickness_mm| ThinMembrane { thickness_mm, ..ThinMembrane::PIA });
            assert_eq!(parse(&text(&used).expect("text")).expect("materials"), used);
        }
    }

    #[test]
    fn a_value_out_of_range_is_named_with_its_region_and_its_range() {
        for (given, told) in [
            (
                "[brain.insertion]\ncut_force_mn = -3",
                "brain.insertion.cut_force_mn is -3, wanted 0 or more (up to 1e9)",
            ),
            (
                "[brain.insertion]\nstatic_friction_mn_per_mm = 0.5",
                "brain.insertion.dynamic_friction_mn_per_mm is 1.04, wanted at most static_friction_mn_per_mm, which is 0.5",
            ),
            ("[ventricles]\npoisson = 0.5", "ventricles.poisson is 0.5, wanted 0 to below 0.4999"),
            ("[brain.membrane]\nyoung_kpa = -1", "brain.membrane.young_kpa is -1, wanted more than 0 (1e-9 to 1e9)"),
            ("[brain]\nyoung_kpa = 1e39", "wanted more than 0 (1e-9 to 1e9)"),
        ] {
            let said = format!("{:#}", said(given).expect_err("refused"));
            assert!(said.ends_with(told), "{said}");
        }
    }

    #[test]
    fn a_name_that_is_none_is_refused_and_the_right_ones_are_told() {
        let told = format!("{:#}", said("[brain]\nyoung = 3.0\n").expect_err("refused"));
        assert!(told.contains("young") && told.contains("young_kpa"), "{told}");
    }
}
