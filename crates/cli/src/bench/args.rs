//! The command line of `monro bench`.

use crate::args::{ModeArg, SceneArgs, elements, in_range, rate};
use clap::{Args, Subcommand, ValueEnum};
use monro_prepare::DEFAULT_ELEMENTS;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct MeshBenchArgs {
    /// Label volumes, cases or scans (which are segmented first), as for "monro mesh" and "monro prepare".
    pub(crate) subjects: Vec<PathBuf>,
    /// Phantoms, seeds 0 to N-1, meshed from their true labels and measured against their analytic surface.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(crate) seeds: u64,
    /// Wanted numbers of tetrahedra.
    #[arg(long, value_name = "N,..", value_delimiter = ',', value_parser = elements, default_values_t = [612, 5_824, 20_677, 37_336, 65_691, 500_000])]
    pub(crate) elements: Vec<usize>,
    /// Threads.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) threads: u16,
    /// Times that each is meshed; the least time of each stage counts.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) repeat: u16,
    /// Bind the outer surface of the voxels to each mesh and move it: "embedding", times and error under a twist.
    #[arg(long)]
    pub(crate) embedding: bool,
    /// Extract and smooth surfaces of a phantom painted into 512 x 512 x 91 voxels: "surfaces", times and volumes.
    #[arg(long)]
    pub(crate) surfaces: bool,
}

#[derive(Debug, Args)]
pub(crate) struct LiveBenchArgs {
    /// A case made by "monro prepare"; without it the built-in phantom.
    pub(crate) case: Option<PathBuf>,
    /// Wanted number of tetrahedra of the phantom: the paper's largest model.
    #[arg(long, value_name = "N", default_value_t = 65_691)]
    pub(crate) elements: usize,
    /// Seconds measured.
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = |t: &str| in_range(t, 0.5, 3600.0))]
    pub(crate) seconds: f64,
    /// Frames of the tracker per second.
    #[arg(long, value_name = "HZ", default_value_t = 240.0, value_parser = rate)]
    pub(crate) rate: f64,
    /// Snapshots that each display asks for per second.
    #[arg(long, value_name = "HZ", default_value_t = 90.0, value_parser = rate)]
    pub(crate) display_rate: f64,
    /// Which soft body.
    #[arg(long, value_enum, default_value_t = ModeArg::Physical)]
    pub(crate) mode: ModeArg,
}

#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Time and peak memory of preparing a scan (default: the phantom) and of simulating an insertion.
    Prepare {
        /// A scan as for "monro prepare"; without it the built-in phantom.
        scan: Option<PathBuf>,
        /// Wanted number of tetrahedra.
        #[arg(long, value_name = "N", default_value_t = DEFAULT_ELEMENTS, value_parser = elements)]
        elements: usize,
    },
    /// Monte-Carlo of tip calibration and registration with simulated cameras: errors at the foramen, predicted and actual.
    Registration {
        /// A case whose skin is touched and traced; without it a made-up head.
        case: Option<PathBuf>,
        /// Trials.
        #[arg(long, value_name = "N", default_value_t = 300)]
        trials: usize,
    },
    /// The live session under load: a camera system at 240 Hz, three displays at 90 Hz, one that has stalled.
    Live(LiveBenchArgs),
    /// The automatic segmentation against phantoms and reference labels (Dice, distances, seconds), and the livewire.
    Segment {
        /// Phantoms, seeds 0 to N-1.
        #[arg(long, value_name = "N", default_value_t = 10)]
        seeds: u64,
        /// A scan, its reference labels, and which of our labels are which of theirs, as "5=1,6=2,7=3+4".
        #[arg(long, num_args = 3, value_names = ["SCAN", "LABELS", "MAP"])]
        against: Vec<String>,
        /// Write slices, clicks and truths of the livewire's session here, for other tools.
        #[arg(long, value_name = "DIR")]
        dump: Option<PathBuf>,
    },
    /// The mesher: seconds of each stage, quality, volumes, topology, distance to the true surface, peak memory; a row for
    /// each subject and size.
    Mesh(MeshBenchArgs),
    /// How long a pose takes from datagram to our hands (NatNet, loopback).
    Latency {
        /// Frames.
        #[arg(long, value_name = "N", default_value_t = 2400, value_parser = clap::value_parser!(u32).range(10..=10_000_000))]
        frames: u32,
        /// Frames per second.
        #[arg(long, value_name = "HZ", default_value_t = 240.0, value_parser = rate)]
        rate: f64,
    },
    /// Time of the soft body's whole frame: collision, deformation, surface update, checks.
    ///
    /// Without --mesh a brain-sized ball of each size is meshed, and a 3 mm rod is pushed into it from ten sides, five times
    /// over. With --mesh the mesh is held by its lowest 15 % of vertices while those within 3 mm of the top are driven 60 mm
    /// down in 2 s: the scene that other engines are compared on. Medians leave out the frames at rest. Each scene is run
    /// twice: for the whole solution, and with the paper's predicted deformation space ("predicted"), whose largest distance
    /// from the whole solution, as a share of the imposed displacement, stands beside its times.
    Frame(FrameArgs),
    /// Error against time of every solver on a static scene with a reference, as for "monro solve": the equilibrium under
    /// growing budgets, both modes stepped to rest, and the baselines of the scene.
    Error(ErrorArgs),
}

#[derive(Debug, Args)]
pub(crate) struct ErrorArgs {
    #[command(flatten)]
    pub(crate) of: SceneArgs,
    /// Longest time for each solver, s.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    pub(crate) seconds: f64,
    /// Plot to write.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) svg: Option<PathBuf>,
    /// Overwrite an existing plot.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug, Args)]
pub(crate) struct FrameArgs {
    /// Sizes of the balls, in tetrahedra.
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_value = "612,5824,20677,37336,65691",
          value_parser = elements_in_range, conflicts_with = "mesh")]
    pub(crate) elements: Vec<usize>,
    /// A mesh to be probed instead (.vtu; regions from its cell array "label" or "region").
    #[arg(long, value_name = "FILE.vtu")]
    pub(crate) mesh: Option<PathBuf>,
    /// What turns the unit of the file into mm: 1000 for metres.
    #[arg(long, value_name = "FACTOR", default_value_t = 1000.0, requires = "mesh", conflicts_with = "elements")]
    pub(crate) scale: f64,
    /// Which work is done.
    #[arg(long, value_enum, default_value_t = ConstraintsArg::Physical)]
    pub(crate) constraints: ConstraintsArg,
    /// Iterations of the solver in a substep.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) iterations: u32,
    /// Substeps of a frame of 1/60 s, 1 to 67: none is shorter than a quarter of a millisecond.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=67))]
    pub(crate) substeps: u32,
    /// Frames of the probe (default: 30 at rest, 120 going down, 30 holding) or of each deformation (default: 20).
    #[arg(long, value_name = "N", value_parser = frames_in_range)]
    pub(crate) frames: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ConstraintsArg {
    /// Lengths of edges and volumes of tetrahedra: the work that all position-based engines do.
    #[value(name = "edges,volumes")]
    EdgesVolumes,
    /// All constraints of the paper.
    Paper,
    /// An elastic solid with moduli.
    Physical,
}

fn elements_in_range(text: &str) -> Result<usize, String> {
    whole_in_range(text, 100, 5_000_000)
}

fn frames_in_range(text: &str) -> Result<usize, String> {
    whole_in_range(text, 2, 1_000_000)
}

fn whole_in_range(text: &str, least: usize, most: usize) -> Result<usize, String> {
    let n: usize = text.trim().parse().map_err(|_| format!("\"{text}\" is no whole number"))?;
    if (least..=most).contains(&n) { Ok(n) } else { Err(format!("{n} is not within {least} to {most}")) }
}
