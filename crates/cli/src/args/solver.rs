//! How a step of the soft body is solved.

use clap::Args;
use monro_tissue::FrameSettings;

#[derive(Debug, Args)]
pub(crate) struct SolverArgs {
    /// Iterations of the solver in each step, 1 to 10000. More carry smooth motion further (docs/speed.md says how far ten do)
    /// and take as much longer.
    #[arg(long, value_name = "N", default_value_t = FrameSettings::default().iterations, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) iterations: u32,
    /// Go on only where the tissue moves more than on average, in every second iteration (two of three where tissue moves
    /// fast; the paper's predicted deformation space): a little faster, and not quite the same.
    #[arg(long)]
    pub(crate) predicted_space: bool,
}

impl SolverArgs {
    /// A frame that is solved so.
    pub(crate) fn frame(&self) -> FrameSettings {
        let Self { iterations, predicted_space } = *self;
        FrameSettings { iterations, predicted_space, ..FrameSettings::default() }
    }
}
