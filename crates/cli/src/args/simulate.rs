//! Options of `monro simulate`.

use super::fields::SIMULATE_FIELDS;
use super::shift::ShiftArgs;
use super::solver::SolverArgs;
use super::{ModeArg, number};
use clap::Args;
use monro_session::CATHETER_MM;
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
    #[arg(long, value_name = "MM", default_value_t = CATHETER_MM, value_parser = number)]
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
    /// TOML file with what to change of the materials of brain and ventricles; docs/materials.md lists all, with units.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) materials: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) shift: ShiftArgs,
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
