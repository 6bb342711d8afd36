//! The loop over the frames, with its clock.

use super::beyond::Beyond;
use super::cutting;
use super::misplaced::Misplaced;
use crate::console::Console;
use anyhow::Result;
use monro_case::Case;
use monro_cli::report::quantile;
use monro_geometry::{Bvh, PassedThrough, Patient, Point, TetLocator, TetMesh, TriangleMesh, Walls};
use monro_guidance::Plan;
use monro_session::{Follower, Frame, Insertion, InsertionSettings, Mode, StructureVolumes};
use std::iter;
use std::time::Instant;

/// Deformed meshes written along the way, besides the last.
const SNAPSHOTS: usize = 10;

/// A frame and what it cost.
#[derive(Debug)]
pub(crate) struct Row {
    /// The frame.
    pub(crate) frame: Frame,
    /// Collision, deformation and update of the surfaces, ms.
    pub(crate) ms: f64,
    /// How far the wall of the ventricles has moved where it has moved most, mm.
    pub(crate) wall_mm: f64,
    /// What each structure has more than at rest, ml, in the order of [`Run::volumes`].
    pub(crate) change_ml: Vec<f64>,
}

/// The deformed mesh at one time.
#[derive(Debug)]
pub(crate) struct Snapshot {
    /// Time since the start, s.
    pub(crate) time_s: f64,
    /// The mesh then.
    pub(crate) mesh: TetMesh,
    /// Where its boundary, or a wall between structures, passes through itself.
    pub(crate) self_crossing: Option<PassedThrough>,
    /// Where its tip is not where it is counted to be, on the way in.
    pub(crate) misplaced: Option<Misplaced>,
}

/// Frames and some of their meshes.
#[derive(Debug)]
pub(crate) struct Stretch {
    /// All frames.
    pub(crate) rows: Vec<Row>,
    /// Some deformed meshes; the last is the end.
    pub(crate) snapshots: Vec<Snapshot>,
}

/// A finished insertion. Its end is that of the catheter's rest at the target; what comes of drawing it out stands by itself.
#[derive(Debug)]
pub(crate) struct Run {
    /// All frames to the end.
    pub(crate) rows: Vec<Row>,
    /// Some deformed meshes; the last is the end.
    pub(crate) snapshots: Vec<Snapshot>,
    /// What came after it, where the catheter was drawn out.
    pub(crate) withdrawal: Option<Stretch>,
    /// The paths of other catheters that stood beside it.
    pub(crate) beside: Vec<Plan>,
    /// Brain surface at the end.
    pub(crate) brain: TriangleMesh,
    /// How far the outer surface of the tissue has moved where it has moved most, at the end, mm.
    pub(crate) cortex_mm: f64,
    /// Ventricle surface at the end.
    pub(crate) ventricles: TriangleMesh,
    /// Whether the case has falx and tentorium.
    pub(crate) case_has_septa: bool,
    /// Depths at which catheters go through falx or tentorium, mm, with their numbers: 0 is that of the plan, then those beside.
    pub(crate) through_septa: Vec<(usize, f64)>,
    /// The first of their paths that leaves the tissue.
    pub(crate) beyond: Option<Beyond>,
    /// Depth at which that of the plan comes into it at rest, mm.
    pub(crate) surface_mm: Option<f64>,
    /// The settings.
    pub(crate) settings: InsertionSettings,
    /// The file that its materials come from, where one was given.
    pub(crate) materials_file: Option<String>,
    /// Remarks that the case came with.
    pub(crate) of_case: Vec<String>,
    /// Name of the patient in the case.
    pub(crate) pseudonym: String,
    /// The planned path.
    pub(crate) plan: Plan,
    /// Nodes at rest, to show displacements against.
    pub(crate) rest: TetMesh,
    /// The structures in it and their volumes.
    pub(crate) volumes: StructureVolumes,
}

impl Run {
    /// The first frame with the tip in a ventricle.
    pub(crate) fn csf(&self) -> Option<&Frame> {
        self.rows.iter().map(|r| &r.frame).find(|f| f.in_ventricle())
    }

    /// The frames between which the tip, in a ventricle before and after, was last outside: the first there, and the first
    /// that was back.
    pub(crate) fn lost_ventricle(&self) -> Option<[&Frame; 2]> {
        let within: Vec<bool> = self.rows.iter().map(|r| r.frame.in_ventricle()).collect();
        last_gap(&within).map(|gap| gap.map(|i| &self.rows[i].frame))
    }

    /// How the tip, in a ventricle on the way, came out of it again; `None` where it never was in one, or is at the end.
    pub(crate) fn left_ventricle(&self) -> Option<String> {
        let last = self.last().filter(|f| !f.in_ventricle())?;
        let within = self.rows.iter().rev().map(|r| &r.frame).find(|f| f.in_ventricle())?;
        let further = last.depth_mm - within.depth_mm;
        Some(match further > 0.05 {
            true => format!("it went {further:.1} mm further, through the far wall"),
            false => "the wall of the ventricle moved over it".into(),
        })
    }

    /// Whether forces are in mN: only in physical mode.
    pub(crate) fn has_units(&self) -> bool {
        matches!(self.settings.model.mode, Mode::Physical(_))
    }

    /// Whether falx and tentorium part the brain.
    pub(crate) const fn has_septa(&self) -> bool {
        self.case_has_septa && self.settings.model.skull.wants_septa()
    }

    /// All frames, with those of the withdrawal.
    pub(crate) fn all_rows(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().chain(self.withdrawal.iter().flat_map(|w| &w.rows))
    }

    /// All meshes, with those of the withdrawal.
    pub(crate) fn all_snapshots(&self) -> impl Iterator<Item = &Snapshot> {
        self.snapshots.iter().chain(self.withdrawal.iter().flat_map(|w| &w.snapshots))
    }

    /// The last frame before any withdrawal.
    pub(crate) fn last(&self) -> Option<&Frame> {
        self.rows.last().map(|r| &r.frame)
    }

    /// Frame time at a share of the frames (0.5: the median), ms.
    pub(crate) fn ms_quantile(&self, share: f64) -> f64 {
        let mut ms: Vec<f64> = self.all_rows().map(|r| r.ms).collect();
        ms.sort_by(f64::total_cmp);
        // As in the histogram of the same page.
        quantile(&ms, share).unwrap_or(f64::NAN)
    }
}

/// The last run of `false` with `true` before and after it: where it begins, and where it is over.
fn last_gap(within: &[bool]) -> Option<[usize; 2]> {
    let last = within.iter().rposition(|w| *w)?;
    let end = within[..last].iter().rposition(|w| !*w)? + 1;
    let begin = within[..end].iter().rposition(|w| *w)? + 1;
    Some([begin, end])
}

/// Surfaces that follow the mesh.
struct Surfaces {
    brain: Follower,
    ventricles: Follower,
}

impl Surfaces {
    fn new(case: &Case) -> Result<Self> {
        Ok(Self {
            brain: Follower::new(&case.tets, &case.brain.vertices)?,
            ventricles: Follower::new(&case.tets, &case.ventricles.vertices)?,
        })
    }

    fn update(&mut self, insertion: &Insertion) {
        insertion.moves(&mut self.brain);
        insertion.moves(&mut self.ventricles);
    }
}

/// Runs the whole insertion, with other catheters that go in along paths of their own before and stay.
pub(crate) fn insert(case: &Case, beside: &[Plan], settings: &InsertionSettings, console: &Console) -> Result<Run> {
    let (mut insertion, mut surfaces) = console.stage("build soft body", || -> Result<_> {
        Ok((Insertion::new(case, beside, settings)?, Surfaces::new(case)?))
    })?;
    let volumes = StructureVolumes::new(insertion.rest());
    let seen = (&volumes, &case.ventricles.vertices[..]);
    let end = insertion.before()[1];
    let Stretch { rows, snapshots } =
        console.stage("insert", || stretch(&mut insertion, &mut surfaces, seen, end, console))?;
    let [brain, ventricles] =
        [&surfaces.brain, &surfaces.ventricles].map(|s| s.points(insertion.origin()).collect::<Vec<_>>());
    let withdraw = || stretch(&mut insertion, &mut surfaces, seen, usize::MAX, console);
    let withdrawal = settings.withdraw.then(|| console.stage("withdraw", withdraw)).transpose()?;
    let locator = TetLocator::new(insertion.rest())?;
    let mut run = Run {
        cortex_mm: snapshots.last().map_or(0.0, |end| surface_mm(insertion.rest(), &end.mesh)),
        rows,
        snapshots,
        withdrawal,
        beside: beside.to_vec(),
        brain: TriangleMesh { vertices: brain, triangles: case.brain.triangles.clone() },
        ventricles: TriangleMesh { vertices: ventricles, triangles: case.ventricles.triangles.clone() },
        case_has_septa: case.septa.is_some(),
        through_septa: through_septa(case, beside),
        beyond: Beyond::first(&locator, iter::once(&case.plan).chain(beside)),
        surface_mm: cutting::surface_mm(&locator, &case.plan),
        settings: *settings,
        materials_file: None,
        of_case: case.manifest.findings.clone(),
        pseudonym: case.manifest.pseudonym.clone(),
        plan: case.plan,
        rest: insertion.rest().clone(),
        volumes,
    };
    console.stage("check walls", || check_walls(&mut run));
    Ok(run)
}

/// Where catheters go through falx or tentorium.
fn through_septa(case: &Case, beside: &[Plan]) -> Vec<(usize, f64)> {
    let Some(tree) = case.septa.as_ref().map(Bvh::new) else { return Vec::new() };
    let plans = iter::once(&case.plan).chain(beside).enumerate();
    plans.filter_map(|(n, plan)| Some((n, plan.first_through(&tree)?))).collect()
}

/// How far the outer surface has moved where it has moved most, mm.
fn surface_mm(rest: &TetMesh, now: &TetMesh) -> f64 {
    let outer = rest.boundary(|_| true).into_iter().flatten().map(|v| v as usize);
    outer.map(|v| rest.vertices[v].distance(now.vertices[v])).fold(0.0, f64::max)
}

/// Where walls pass through each other in the meshes.
fn check_walls(run: &mut Run) {
    let walls = Walls::new(&run.rest);
    let out = run.withdrawal.iter_mut().flat_map(|w| &mut w.snapshots);
    run.snapshots.iter_mut().chain(out).for_each(|s| s.self_crossing = walls.passed_through(&s.mesh.vertices));
}

/// The frames up to a number of them, or to the end.
fn stretch(
    insertion: &mut Insertion,
    surfaces: &mut Surfaces,
    (volumes, walls): (&StructureVolumes, &[Point<Patient>]),
    until: usize,
    console: &Console,
) -> Result<Stretch> {
    let (mut rows, mut snapshots) = (Vec::new(), Vec::new());
    let ((begun, total), [before, _]) = (insertion.progress(), insertion.before());
    let end = until.min(total);
    // Of the insertion: before it a mesh of what fluid, gravity and other catheters have done.
    let from = begun.max(before);
    let every = (end - from).div_ceil(SNAPSHOTS).max(1);
    let mut in_csf = begun > 0;
    while insertion.progress().0 < end {
        let start = Instant::now();
        let Some(frame) = insertion.advance()? else { break };
        surfaces.update(insertion);
        let ms = start.elapsed().as_secs_f64() * 1000.0;
        if frame.in_ventricle() && !in_csf {
            console.note(&format!("CSF at a depth of {:.1} mm, {:.2} s", frame.depth_mm, frame.time_s));
            in_csf = true;
        }
        let (done, _) = insertion.progress();
        if done >= from && ((done - from) % every == 0 || done == end) {
            let what = if begun > 0 { "withdraw" } else { "insert" };
            console.progress(format!("{what}: frame {done} of {total}, depth {:.1} mm", frame.depth_mm));
            let (time_s, mesh) = (frame.time_s, insertion.deformed());
            let misplaced = if begun > 0 { None } else { Misplaced::of(&frame, &mesh) };
            snapshots.push(Snapshot { time_s, mesh, self_crossing: None, misplaced });
        }
        let walls_now = surfaces.ventricles.points(insertion.origin());
        let wall_mm = walls.iter().zip(walls_now).map(|(rest, now)| rest.distance(now)).fold(0.0, f64::max);
        rows.push(Row { frame, ms, wall_mm, change_ml: volumes.change_ml(insertion.nodes()) });
    }
    Ok(Stretch { rows, snapshots })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ventricle_left_on_the_way_is_found_wherever_the_run_ends() {
        let gap = |text: &str| last_gap(&text.chars().map(|c| c == '#').collect::<Vec<_>>());
        assert_eq!(gap("..##...#"), Some([4, 7]));
        assert_eq!(gap("##.#..."), Some([2, 3]));
        assert_eq!(gap("#.##..##"), Some([4, 6]));
        assert_eq!([gap(""), gap("..##"), gap("##.."), gap("....")], [None; 4]);
    }
}
