//! The command line.

mod fields;
mod path;
mod shift;
mod simulate;
mod solver;

use crate::bench::args::BenchCommand;
use crate::trackers::{DoctorArgs, FakeTrackerCommand, TrackArgs};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use fields::SOLVE_FIELDS;
use monro_prepare::DEFAULT_ELEMENTS;
pub(crate) use path::path;
use shift::ShiftArgs;
pub(crate) use simulate::SimulateArgs;
use solver::SolverArgs;
use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Monro makes a patient model from a head CT, and simulates and guides the insertion of a catheter into its ventricles.
/// Research software, not for clinical use. Begin with "monro demo", or with "monro prepare SCAN --out CASE".
#[derive(Debug, Parser)]
#[command(name = "monro", version, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// Print one JSON object on stdout instead of text ("track": one a pose; "fake-tracker": nothing). Progress and warnings
    /// always go to stderr.
    #[arg(long, global = true, display_order = 900)]
    pub(crate) json: bool,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Prepare the built-in phantom, simulate an insertion and write a report.
    Demo(DemoArgs),
    /// Say what a scan is: series, size, spacing, warnings.
    Inspect(InspectArgs),
    /// Write a digital phantom as a DICOM series with its true labels and landmarks.
    Phantom(PhantomArgs),
    /// Make a case from a head CT: labels, surfaces, tetrahedra, plan.
    Prepare(PrepareArgs),
    /// Correct the labels of a scan or a case in the browser, and build the case again.
    Edit(EditArgs),
    /// Convert labels from and for other programs.
    #[command(subcommand)]
    Labels(LabelsCommand),
    /// Simulate the insertion of a catheter along the plan of a case.
    Simulate(SimulateArgs),
    /// Solve a static scene (JSON and meshes in SI) for its displacement and its reactions.
    Solve(SolveArgs),
    /// Guide a live insertion in the browser and in 3D Slicer, by a real tracker or a scripted one.
    Serve(ServeArgs),
    /// Play a recorded session again and compare its snapshots with those that were shown.
    Replay(ReplayArgs),
    /// Make graded tetrahedra from a label volume, or again from a case.
    Mesh(MeshArgs),
    /// Print live poses of a tracker with their age and quality (with --json one object a pose).
    Track(TrackArgs),
    /// Act as Motive (NatNet) or as PLUS (OpenIGTLink) and play a scene; nothing is printed on stdout.
    #[command(subcommand)]
    FakeTracker(FakeTrackerCommand),
    /// Say why there are no poses.
    Doctor(DoctorArgs),
    /// Find tips, shafts, cameras and see-through displays.
    #[command(subcommand)]
    Calibrate(CalibrateCommand),
    /// Register the patient by touched landmarks and a traced skin.
    Register(RegisterArgs),
    /// Measure speed and memory on this machine.
    #[command(subcommand)]
    Bench(BenchCommand),
}

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Folder for everything the demo makes.
    #[arg(long, value_name = "DIR", default_value = "monro-demo")]
    pub(crate) out: PathBuf,
    /// End with the report instead of the live view. Without a terminal this goes without saying.
    #[arg(long)]
    pub(crate) headless: bool,
    /// End in the live view also without a terminal.
    #[arg(long, conflicts_with = "headless")]
    pub(crate) live: bool,
    /// Overwrite an existing output folder.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug, Args)]
pub(crate) struct InspectArgs {
    /// A DICOM folder or file, or a NIfTI, NRRD or MetaImage file.
    pub(crate) path: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct PhantomArgs {
    /// Folder to write.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Seed: varies size, ventricles, asymmetry, head position, noise.
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Which phantom.
    #[arg(long, value_enum, default_value_t = PhantomKind::Head)]
    pub(crate) kind: PhantomKind,
    /// Overwrite an existing output folder.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PhantomKind {
    /// A head with scalp, skull, brain and ventricles.
    Head,
    /// The paper's gelatin phantom: a box of tissue with a fluid container.
    Drawer,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SideArg {
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ModeArg {
    /// The paper's position-based dynamics with normalised coefficients.
    Paper,
    /// Stiffness in kPa and Poisson's ratio.
    Physical,
}

/// What the skull does to the surface of the brain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SkullArg {
    /// It holds it in place.
    Held,
    /// The brain slides along it and may leave it.
    Slides,
}

#[derive(Debug, Args)]
pub(crate) struct PrepareArgs {
    /// A DICOM folder or file, or a NIfTI, NRRD or MetaImage file.
    pub(crate) scan: PathBuf,
    /// Folder of the new case.
    #[arg(long, value_name = "CASE")]
    pub(crate) out: PathBuf,
    /// Wanted number of tetrahedra (500 to 20 million).
    #[arg(long, value_name = "N", default_value_t = DEFAULT_ELEMENTS, value_parser = elements)]
    pub(crate) elements: usize,
    /// Side of the entry (default: right, or the side of --plan).
    #[arg(long, value_enum)]
    pub(crate) side: Option<SideArg>,
    /// Use these labels instead of segmenting: NIfTI, NRRD, MetaImage (numbers as in labels.nii.gz), .seg.nrrd or DICOM-SEG
    /// (segments by their terms or names).
    #[arg(long, value_name = "FILE")]
    pub(crate) labels: Option<PathBuf>,
    /// Use this plan (3D Slicer markups, entry and target) instead of Kocher's point and the foramen of Monro.
    #[arg(long, value_name = "FILE.mrk.json")]
    pub(crate) plan: Option<PathBuf>,
    /// Take this DICOM series instead of the best one: its short id, as "monro inspect" shows it, or its UID.
    #[arg(long, value_name = "ID")]
    pub(crate) series: Option<String>,
    /// Overwrite an existing case.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug, Args)]
pub(crate) struct EditArgs {
    /// A case made by "monro prepare", or a scan as for it.
    #[arg(value_name = "CASE|SCAN")]
    pub(crate) path: PathBuf,
    /// Folder of the case to be built from a scan.
    #[arg(long, value_name = "CASE")]
    pub(crate) out: Option<PathBuf>,
    /// Begin with these labels instead of those of the case or the automatic ones.
    #[arg(long, value_name = "FILE")]
    pub(crate) labels: Option<PathBuf>,
    /// Take this DICOM series instead of the best one: its short id, as "monro inspect" shows it, or its UID.
    #[arg(long, value_name = "ID")]
    pub(crate) series: Option<String>,
    /// Loopback address to listen on; port 0 takes any free port.
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0", value_parser = address)]
    pub(crate) listen: SocketAddr,
}

#[derive(Debug, Subcommand)]
pub(crate) enum LabelsCommand {
    /// Convert labels between NIfTI (.nii.gz), 3D Slicer (.seg.nrrd) and DICOM-SEG (.dcm).
    Convert {
        /// NIfTI, NRRD, .seg.nrrd, MetaImage or DICOM-SEG; named segments get the numbers of a case.
        from: PathBuf,
        /// File to write; its name chooses the format.
        out: PathBuf,
        /// Put the labels on the grid of this scan.
        #[arg(long, value_name = "SCAN")]
        like: Option<PathBuf>,
        /// For a .dcm: put the labels on the planes of these DICOM images and refer to them. Patient and study are those
        /// of the images; without this the file names nobody and refers to nothing.
        #[arg(long, value_name = "FOLDER", conflicts_with = "like")]
        images: Option<PathBuf>,
        /// Take this series of the images (short id of "monro inspect", or UID) instead of the best one.
        #[arg(long, value_name = "ID", requires = "images")]
        series: Option<String>,
        /// Overwrite an existing file.
        #[arg(long)]
        force: bool,
    },
}

/// The command line. Values may begin with a minus: what cannot be negative says so itself.
pub(crate) fn parse(given: impl IntoIterator<Item = OsString>) -> Cli {
    fn negative(command: clap::Command) -> clap::Command {
        let with_sign = |a: clap::Arg| if a.get_action().takes_values() { a.allow_negative_numbers(true) } else { a };
        command.mut_args(with_sign).mut_subcommands(negative)
    }
    let found = negative(Cli::command()).get_matches_from(joined(given));
    Cli::from_arg_matches(&found).unwrap_or_else(|e| e.exit())
}

/// The arguments with three numbers after `--gravity` made one: a parser that took up to three values would also take what
/// follows them.
fn joined(given: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let number = |a: &OsString| a.to_str().is_some_and(|t| t.trim_end_matches(',').parse::<f64>().is_ok());
    let mut out: Vec<OsString> = Vec::new();
    let mut rest = given.into_iter().peekable();
    while let Some(argument) = rest.next() {
        let gravity = argument == "--gravity";
        out.push(argument);
        let mut values = Vec::new();
        while gravity && values.len() < 3 {
            let Some(value) = rest.next_if(number) else { break };
            values.push(value.to_string_lossy().trim_end_matches(',').to_owned());
        }
        if !values.is_empty() {
            out.push(values.join(",").into());
        }
    }
    out
}

fn milliseconds(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| "wanted whole milliseconds from 0, as 60000 for a minute".into())
}

// A case of a static scene on one of its meshes. (A doc comment here would become the about of the commands.)
#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    /// The scene: a JSON file with its meshes beside it, in SI, or the folder of a scene.json. docs/scenes.md describes it,
    /// examples/block is one.
    #[arg(value_name = "SCENE.json")]
    pub(crate) scene: PathBuf,
    /// Which of its meshes.
    #[arg(long, value_name = "NAME")]
    pub(crate) mesh: String,
    /// Which of its cases.
    #[arg(long, value_name = "NAME")]
    pub(crate) case: String,
}

#[derive(Debug, Args)]
#[command(after_help = SOLVE_FIELDS)]
pub(crate) struct SolveArgs {
    #[command(flatten)]
    pub(crate) of: SceneArgs,
    /// File to write (metres, point array "displacement").
    #[arg(long, value_name = "OUT.vtu")]
    pub(crate) out: PathBuf,
    /// Overwrite an existing file.
    #[arg(long)]
    pub(crate) force: bool,
    /// Which soft body.
    #[arg(long, value_enum, default_value_t = ModeArg::Physical)]
    pub(crate) mode: ModeArg,
    /// Stop after so many milliseconds with the best so far, and say so [default: 600000, ten minutes].
    #[arg(long, value_name = "N", value_parser = milliseconds)]
    pub(crate) budget_ms: Option<u64>,
    /// How often every element is cut into eight inside the solver, 0 to 3 (physical mode; default: as long as that gives no more
    /// than 80,000, then smaller where the answer is least certain). Around rods and spheres the mesh is refined in any case.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=3))]
    pub(crate) refine: Option<u32>,
}

#[derive(Debug, Args)]
#[command(override_usage = "monro serve [OPTIONS] <CASE>\n       monro serve [OPTIONS] --scans <DIR> --out <CASE>")]
pub(crate) struct ServeArgs {
    /// A case made by "monro prepare".
    #[arg(required_unless_present = "scans", conflicts_with = "scans")]
    pub(crate) case: Option<PathBuf>,
    /// Begin without a case: choose one of the scans in this folder in the browser, and prepare it there. For this machine
    /// only; other devices come in when the case is served by itself.
    #[arg(long, value_name = "DIR", requires = "out", conflicts_with_all = ["tls", "cert", "host"])]
    pub(crate) scans: Option<PathBuf>,
    /// Folder for the case that is prepared with --scans; it must not be there yet.
    // "requires" alone does not ask for what the case excludes.
    #[arg(long, value_name = "CASE", requires = "scans", conflicts_with = "case")]
    pub(crate) out: Option<PathBuf>,
    /// Where poses come from: "sim:" plays an insertion along the plan; else as for "monro track".
    #[arg(long, value_name = "URL", default_value = "sim:")]
    pub(crate) tracker: String,
    /// Address to listen on; port 0 takes any free port. What others can reach (0.0.0.0:8443) is encrypted, and other
    /// devices come in by the QR code or the pairing code that is printed.
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0", value_parser = address)]
    pub(crate) listen: SocketAddr,
    /// Certificate to encrypt with (PEM), instead of one made at start.
    #[arg(long, value_name = "FILE.pem", requires = "key")]
    pub(crate) cert: Option<PathBuf>,
    /// Its private key (PEM).
    #[arg(long, value_name = "FILE.pem", requires = "cert")]
    pub(crate) key: Option<PathBuf>,
    /// Encrypt with a certificate made at start also when only this machine can reach the address.
    #[arg(long)]
    pub(crate) tls: bool,
    /// A name under which this machine may be reached, beside its addresses; may be given again.
    #[arg(long, value_name = "NAME")]
    pub(crate) host: Vec<String>,
    /// Loopback address on which 3D Slicer is served (OpenIGTLink); when it is taken, any free port.
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:18945", value_parser = address)]
    pub(crate) igtl: SocketAddr,
    /// Serve no OpenIGTLink.
    #[arg(long, conflicts_with = "igtl")]
    pub(crate) no_igtl: bool,
    /// New file for the recording of the session (default: CASE-sessions/DATE.mnrs beside the case).
    #[arg(long, value_name = "FILE", conflicts_with = "no_record")]
    pub(crate) record: Option<PathBuf>,
    /// Record nothing.
    #[arg(long)]
    pub(crate) no_record: bool,
    /// Which soft body.
    #[arg(long, value_enum, default_value_t = ModeArg::Physical)]
    pub(crate) mode: ModeArg,
    /// TOML file with what to change of the materials of brain and ventricles (physical mode); docs/materials.md lists all,
    /// with units. The recording keeps them.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) materials: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) shift: ShiftArgs,
    #[command(flatten)]
    pub(crate) solver: SolverArgs,
}

#[derive(Debug, Args)]
pub(crate) struct PosesArgs {
    /// As for "monro track"; a recording is taken whole.
    pub(crate) url: String,
    /// The tool, with or without the `ToTracker` that PLUS adds.
    #[arg(long, value_name = "NAME", default_value = "Stylus")]
    pub(crate) tool: String,
    /// How long to collect from a live tracker, s.
    #[arg(long, value_name = "S", default_value_t = 15.0, value_parser = |t: &str| in_range(t, 0.5, 3600.0))]
    pub(crate) seconds: f64,
}

#[derive(Debug, Subcommand)]
pub(crate) enum CalibrateCommand {
    /// Tip of a tool that swings in a cone about its resting tip.
    Pivot(PosesArgs),
    /// Shaft of a tool that is turned about it in a guide.
    Axis {
        #[command(flatten)]
        poses: PosesArgs,
        /// The tip in the tool's frame, mm: towards it the axis points.
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
        tip: String,
        /// A point of the shaft at the hub, mm, from which the axis points to the tip: needed where the frame has its origin
        /// at the tip.
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, default_value = "0,0,0")]
        hub: String,
    },
    /// Lens and place of a camera from corners: lines "x y z u v" (mm in the tracker, pixels).
    Camera {
        /// The lines.
        corners: PathBuf,
        /// Size of the picture, pixels.
        #[arg(long, value_name = "WIDTHxHEIGHT")]
        size: String,
    },
    /// Optical see-through glasses from alignments (SPAAM): lines "x y z u v" (mm in the tracked body on the head, pixels).
    Display {
        /// The lines.
        alignments: PathBuf,
    },
}

#[derive(Debug, Args)]
pub(crate) struct RegisterArgs {
    /// A case made by "monro prepare".
    pub(crate) case: PathBuf,
    /// Touched landmarks: lines "NAME,X,Y,Z", mm in the frame of the reference body. The names are those of the marked
    /// landmarks: of the case (nasion, midline above nasion, Kocher left, Kocher right, ...; see its landmarks.mrk.json) or
    /// of --marked.
    #[arg(long, value_name = "FILE")]
    pub(crate) landmarks: PathBuf,
    /// Where the landmarks are marked (3D Slicer markups), instead of the case's own.
    #[arg(long, value_name = "FILE.mrk.json")]
    pub(crate) marked: Option<PathBuf>,
    /// Points traced on the skin: lines "X Y Z", mm in the frame of the reference body.
    #[arg(long, value_name = "FILE")]
    pub(crate) surface: Option<PathBuf>,
    /// A landmark touched as a check: one that was not touched for the registration says most.
    #[arg(long, value_name = "NAME,X,Y,Z", allow_hyphen_values = true)]
    pub(crate) check: Option<String>,
    /// Standard deviation of a touch along each axis, mm.
    #[arg(long, value_name = "MM", default_value_t = 1.0, value_parser = |t: &str| in_range(t, 0.001, 100.0))]
    pub(crate) touch_sigma: f64,
    /// Standard deviation of a traced point along each axis, mm.
    #[arg(long, value_name = "MM", default_value_t = 0.5, value_parser = |t: &str| in_range(t, 0.001, 100.0))]
    pub(crate) trace_sigma: f64,
}

#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// A recording of "monro serve".
    pub(crate) recording: PathBuf,
    /// The case, where it is not where it was.
    #[arg(long, value_name = "CASE")]
    pub(crate) case: Option<PathBuf>,
    /// Write the numbers of each snapshot to this new file, one JSON object a line.
    #[arg(long, value_name = "FILE.jsonl")]
    pub(crate) out: Option<PathBuf>,
    /// Overwrite an existing file.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug, Args)]
pub(crate) struct MeshArgs {
    /// A label volume (NIfTI, NRRD, MetaImage) or a case; or a mesh to check and convert (.vtu, .msh, .ply, .stl), of which
    /// only --strict, --out and --force make sense. A mesh is LPS mm unless it says SPACE=RAS as 3D Slicer does.
    #[arg(value_name = "LABELS|CASE|MESH")]
    pub(crate) labels: PathBuf,
    /// Labels to mesh, numbers as 4,5 (default: all but 0; of a case, everything inside the skull).
    #[arg(long, value_name = "LABEL,..", value_delimiter = ',', value_parser = crate::mesh::label)]
    pub(crate) keep: Option<Vec<u16>>,
    /// Labels to be fine around (default: the ventricles of a case or its labels, else all).
    #[arg(long, value_name = "LABEL,..", value_delimiter = ',', value_parser = crate::mesh::label)]
    pub(crate) fine: Option<Vec<u16>>,
    /// A path to be fine along, LPS mm (default: the plan of a case).
    #[arg(long, value_name = "X,Y,Z:X,Y,Z", allow_hyphen_values = true)]
    pub(crate) path: Option<String>,
    /// Wanted number of tetrahedra (500 to 20 million; 37336 if not given).
    #[arg(long, value_name = "N", value_parser = elements)]
    pub(crate) elements: Option<usize>,
    /// How many more elements a volume of a label gets than it would, against the others, e.g. 4=8,7=0.125 (0.01 to 100):
    /// beside what --fine and --path ask for, which give labels there many times more. Cells halve, so what comes of it lies
    /// near 1, 8 or 64; a remark says by how much it misses.
    #[arg(long, value_name = "LABEL=FACTOR,..")]
    pub(crate) density: Option<String>,
    /// Growth of the edges with the distance from what is fine, mm a mm (0.01 to 2; 0.7 if not given).
    #[arg(long, value_name = "MM", value_parser = crate::mesh::growth)]
    pub(crate) growth: Option<f64>,
    /// Longest edge over the finest (1 to 64; 5 if not given).
    #[arg(long, value_name = "RATIO", value_parser = crate::mesh::coarsest)]
    pub(crate) coarsest: Option<f64>,
    /// Refuse a mesh in which the surface of a label, or of all together, is not two-manifold or has another topology than
    /// the labels, or is off them by more than one and a half edges (a slit that is bridged), a hole or tunnel of a voxel or
    /// so is closed, a label has no element or a volume that is off by more than 1 %, or an element is of bad shape, naming
    /// what and where, instead of a remark. Of a mesh that is checked: bad shapes, parts that overlap, surfaces that are not
    /// two-manifold, hanging nodes, doubled vertices; a surface that is open, inside out or passes through itself.
    #[arg(long)]
    pub(crate) strict: bool,
    /// File to write: tetrahedra as .vtu or .msh (Gmsh 4.1, with the interfaces as triangles), the outer surface as .ply or
    /// .stl, the surface of each label as .obj or .glb.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Page to write about a mesh made of labels (.html): cuts by label and by shape, grading, each label against its voxels.
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Overwrite existing files.
    #[arg(long)]
    pub(crate) force: bool,
}

/// Frames per second.
pub(crate) fn rate(text: &str) -> Result<f64, String> {
    in_range(text, 0.1, 2000.0)
}

/// A number without its unit, which the help names.
fn number(text: &str) -> Result<f64, String> {
    let n: Option<f64> = text.trim().parse().ok();
    n.filter(|n| n.is_finite()).ok_or_else(|| "wanted a number without a unit, as 5 or 2.5".into())
}

/// An address with a port.
fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "wanted ADDRESS:PORT, as 127.0.0.1:9000 or [::1]:9000; port 0 takes any free one".into())
}

/// A number within limits.
pub(crate) fn in_range(text: &str, least: f64, most: f64) -> Result<f64, String> {
    let n: f64 = text.trim().parse().map_err(|_| format!("\"{text}\" is no number"))?;
    if (least..=most).contains(&n) { Ok(n) } else { Err(format!("{n} is not within {least} to {most}")) }
}

/// A number of tetrahedra that the mesher takes.
pub(crate) fn elements(text: &str) -> Result<usize, String> {
    let range = monro_anatomy::tetra::ELEMENTS;
    let rule = || {
        format!("the number of elements must be a whole number from {} to {}, in digits", range.start(), range.end())
    };
    text.parse().ok().filter(|n| range.contains(n)).ok_or_else(rule)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_elements_within_the_range_was_said_to_be_outside() {
        assert_eq!(elements("1000000"), Ok(1_000_000));
        for given in ["1e6", "37336.5", "400"] {
            assert!(elements(given).is_err_and(|e| e.contains("a whole number")), "{given}");
        }
    }

    #[test]
    fn options_of_serve_that_count_nowhere_were_taken_without_a_word() {
        for line in ["CASE", "CASE --no-igtl", "CASE --igtl 127.0.0.1:1", "--scans DIR --out CASE"] {
            assert!(Cli::try_parse_from(format!("monro serve {line}").split(' ')).is_ok(), "{line}");
        }
        for line in ["CASE --out OTHER", "CASE --no-igtl --igtl 127.0.0.1:1", "--scans DIR", "CASE --scans DIR"] {
            assert!(Cli::try_parse_from(format!("monro serve {line}").split(' ')).is_err(), "{line}");
        }
    }

    #[test]
    fn gravity_with_commas_was_refused_and_one_with_spaces_must_not_take_what_follows() {
        for given in ["--gravity 0,-9.81,0", "--gravity -0 -9.81 0", "--gravity=0,-9.81,0", "--gravity 0, -9.81, 0"] {
            let line = format!("monro simulate {given} CASE --out DIR");
            let cli = Cli::try_parse_from(joined(line.split(' ').map(OsString::from))).expect(given);
            let Command::Simulate(args) = cli.command else { panic!("{given}") };
            assert_eq!((args.shift.gravity, args.case), (Some([0.0, -9.81, 0.0]), PathBuf::from("CASE")), "{given}");
        }
        for given in ["--gravity 0,9", "--gravity nan,0,0", "--gravity 0 9", "--gravity"] {
            let line = format!("monro simulate CASE {given} --out DIR");
            assert!(Cli::try_parse_from(joined(line.split(' ').map(OsString::from))).is_err(), "{given}");
        }
    }
}
