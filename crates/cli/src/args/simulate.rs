//! Options of `monro simulate`.

use super::fields::SIMULATE_FIELDS;
use super::solver::SolverArgs;
use super::{ModeArg, SkullArg, number};
use crate::simulate::DIAMETER_MM;
use clap::Args;
use monro_tissue::TipShape;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = SIMULATE_FIELDS)]
pub(crate) struct SimulateArgs {
    /// A case made by "monro prepare".
    pub(crate) case: PathBuf,
    /// Folder for the results.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Speed of the tip along the plan, mm/s.
    #[arg(long, value_name = "MM_PER_S", default_value_t = 10.0, value_parser = number)]
    pub(crate) speed: f64,
    /// Outer diameter of the catheter, mm (9 Fr is 3 mm, as in the paper), 0.5 to 8.
    #[arg(long, value_name = "MM", default_value_t = DIAMETER_MM, value_parser = number)]
    pub(crate) diameter: f64,
    /// Shape of its tip: "round", or "cone:DEGREES" with the angle between the cone's side and its axis, 3 to 86.
    #[arg(long, value_name = "SHAPE", default_value = "round", value_parser = tip)]
    pub(crate) tip: TipShape,
    /// Draw the catheter out again after a second at the target, at the same speed. The results stay those of that second's
    /// end; what comes of the withdrawal stands beside them.
    #[arg(long)]
    pub(crate) withdraw: bool,
    /// Another catheter, alike, that goes in along a path of its own before, from X,Y,Z to X,Y,Z (LPS mm; entry outside of the
    /// brain), and stays. May be given several times: they go in one after the other.
    #[arg(long, value_name = "X,Y,Z:X,Y,Z", allow_hyphen_values = true)]
    pub(crate) beside: Vec<String>,
    // Only to say where it belongs.
    #[arg(long, hide = true)]
    pub(crate) side: Option<String>,
    /// Which soft body.
    #[arg(long, value_enum, default_value_t = ModeArg::Physical)]
    pub(crate) mode: ModeArg,
    /// Cerebrospinal fluid drained from the ventricles, ml (negative: infused; physical mode), within three seconds before the
    /// insertion. More than they hold is refused; suction ends at three times the brain's shear modulus (23 mmHg), so
    /// that after about half to two thirds no more is drained, which is told: walls that meet are not modelled.
    #[arg(long, value_name = "ML", allow_hyphen_values = true, value_parser = number, conflicts_with = "csf_pressure_mmhg")]
    pub(crate) drain_ml: Option<f64>,
    /// How much more the pressure in the ventricles exceeds that at the surface of the brain (transmural) than in the scan,
    /// mmHg (physical mode). Measured differences are a few mmHg: an intracranial pressure that is high everywhere deforms
    /// nothing. It rises within a second that is over half a second before the insertion.
    #[arg(long, value_name = "MMHG", allow_hyphen_values = true, value_parser = number)]
    pub(crate) csf_pressure_mmhg: Option<f64>,
    /// TOML file with what to change of the materials of brain and ventricles; docs/materials.md lists all, with units.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) materials: Option<PathBuf>,
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
    #[command(flatten)]
    pub(crate) solver: SolverArgs,
    /// Overwrite an existing output folder.
    #[arg(long)]
    pub(crate) force: bool,
}

/// The shape of a tip.
fn tip(text: &str) -> Result<TipShape, String> {
    let degrees = text.trim().strip_prefix("cone:").and_then(|d| d.trim().parse().ok());
    match degrees.filter(|d| (3.0..=86.0).contains(d)) {
        Some(d) => Ok(TipShape::Cone { half_angle: f64::to_radians(d) }),
        None if text.trim() == "round" => Ok(TipShape::Round),
        None => Err("wanted round, or cone:DEGREES with 3 to 86 degrees between side and axis, as cone:20".into()),
    }
}

/// Three numbers with commas between them.
fn triple(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split([',', ' ']).filter(|n| !n.is_empty()).map(str::parse).collect();
    let three = numbers.ok().and_then(|n| <[f64; 3]>::try_from(n).ok());
    three.filter(|n| n.iter().all(|v| v.is_finite())).ok_or_else(|| "wanted three finite numbers, as 0,9.81,0".into())
}
