//! Options for brain shift: what is done to the fluid, gravity, and what the skull does.

use super::{ModeArg, SkullArg, number};
use crate::soft_body;
use anyhow::{Result, ensure};
use clap::Args;
use monro_session::{KPA_PER_MMHG, Loads, Skull};
use monro_tissue::Csf;

/// Where the brain may shift to, and why.
#[derive(Debug, Args)]
pub(crate) struct ShiftArgs {
    /// Cerebrospinal fluid drained from the ventricles, ml (negative: infused; physical mode), within three seconds before
    /// anything else. More than they hold is refused; suction ends at three times the brain's shear modulus (23 mmHg), so
    /// that after about half to two thirds no more is drained, which is told: walls that meet are not modelled.
    #[arg(long, value_name = "ML", allow_hyphen_values = true, value_parser = number, conflicts_with = "csf_pressure_mmhg")]
    pub(crate) drain_ml: Option<f64>,
    /// How much more the pressure in the ventricles exceeds that at the surface of the brain (transmural) than in the scan,
    /// mmHg (physical mode). Measured differences are a few mmHg: an intracranial pressure that is high everywhere deforms
    /// nothing. It rises within a second that is over half a second before anything else.
    #[arg(long, value_name = "MMHG", allow_hyphen_values = true, value_parser = number)]
    pub(crate) csf_pressure_mmhg: Option<f64>,
    /// Acceleration that the tissue has begun to feel since the scan, m/s2, LPS: lost buoyancy, another position of the head.
    /// As "0,9.81,0" or as three numbers after each other.
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub(crate) gravity: Option<[f64; 3]>,
    /// What the skull does to the surface of the brain outside of the burr hole: "held" in place, or "slides": it slides along
    /// the skull and may leave it, for brain shift once fluid around it is lost. The lowest 15 mm stay held. Takes
    /// about twice as long.
    #[arg(long, value_enum, default_value_t = SkullArg::Held)]
    pub(crate) skull: SkullArg,
    /// With --skull slides: leave out falx and tentorium, which the brain else does not go through where the case has them. They are
    /// about where an average head has them (see the case's report), rigid, and tissue slides along them, both sides together.
    #[arg(long)]
    pub(crate) no_septa: bool,
}

impl ShiftArgs {
    /// What is done to the fluid, and gravity.
    pub(crate) fn loads(&self, mode: ModeArg) -> Result<Loads> {
        let csf = match (self.drain_ml, self.csf_pressure_mmhg) {
            (Some(ml), _) => Csf::Drained { ml },
            (_, Some(mmhg)) => Csf::Pressure { kpa: mmhg * KPA_PER_MMHG },
            (None, None) => Csf::AtRest,
        };
        let gravity_mm_s2 = self.gravity.unwrap_or_default().map(|g| g * 1e3);
        let loads = Loads { csf, gravity_mm_s2 };
        loads.check(soft_body::of(mode).mode)?;
        Ok(loads)
    }

    /// What the skull does.
    pub(crate) fn skull(&self) -> Result<Skull> {
        let skull = match self.skull {
            SkullArg::Held => Skull::Held,
            SkullArg::Slides => Skull::Slides { septa: !self.no_septa },
        };
        ensure!(
            skull.slides() || !self.no_septa,
            "--no-septa belongs to --skull slides: falx and tentorium have no part in a brain that is held at the skull"
        );
        Ok(skull)
    }
}

/// Three numbers with commas between them.
fn triple(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split([',', ' ']).filter(|n| !n.is_empty()).map(str::parse).collect();
    let three = numbers.ok().and_then(|n| <[f64; 3]>::try_from(n).ok());
    three.filter(|n| n.iter().all(|v| v.is_finite())).ok_or_else(|| "wanted three finite numbers, as 0,9.81,0".into())
}
