//! A tip that is not where it is counted to be: walls yield at what materials say, and the mesh knows where they are.

use super::Run;
use monro_geometry::{Patient, Point, Structure, TetLocator, TetMesh, Vector};
use monro_session::Frame;
use monro_tissue::TipShape;

/// A tip with the same structure so far around it, mm, touches no wall.
const CLEAR: f64 = 0.5;

/// A tip in the midst of another structure than the one that it is counted to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Misplaced {
    depth_mm: f64,
    /// By the mesh.
    there: Option<Structure>,
    /// By the walls that have yielded.
    counted: Option<Structure>,
}

impl Misplaced {
    /// In a frame with its mesh; `None` where both agree, or a wall is near.
    pub(super) fn of(frame: &Frame, mesh: &TetMesh) -> Option<Self> {
        let kind = |s: Option<Structure>| s.map(Structure::is_ventricle);
        let (there, counted) = (in_the_midst(mesh, frame.tip)?, frame.at_tip);
        (kind(there) != kind(counted)).then_some(Self { depth_mm: frame.depth_mm, there, counted })
    }
}

/// At the end of a run.
pub(super) fn at_end(run: &Run) -> Option<String> {
    run.snapshots.last()?.misplaced.and_then(|_| words(run))
}

/// On the way, where it is right at the end. Once is none: just before a wall yields, a tip may be through by a millimetre.
pub(super) fn on_the_way(run: &Run) -> Option<String> {
    let often = run.snapshots.iter().filter(|s| s.misplaced.is_some()).count() > 1;
    let is_right = run.snapshots.last()?.misplaced.is_none();
    (often && is_right).then(|| words(run)).flatten()
}

/// How often, and the first; `None` in paper mode, whose forces pierce nothing.
fn words(run: &Run) -> Option<String> {
    let found: Vec<Misplaced> = run.snapshots.iter().filter_map(|s| s.misplaced).collect();
    let Misplaced { depth_mm, there, counted } = found.first().filter(|_| run.has_units())?;
    let name = |s: &Option<Structure>| s.map_or("no simulated tissue".into(), Structure::words);
    Some(format!(
        "In {} of the {} meshes looked at the tip lies in another structure than the one it is counted to (the first \
         at {depth_mm:.1} mm under the skin: in {} by the mesh, in {} by the walls that have yielded): the materials' \
         puncture_force_mn and puncture_depth_mm{} let a wall yield that is only touched, or none that is gone through. Do not \
         rely on what is said of the structures at the tip, nor on CSF.",
        found.len(),
        run.snapshots.len(),
        name(there),
        name(counted),
        slender(run).unwrap_or_default()
    ))
}

/// A tip that goes through a wall long before its widest part does.
fn slender(run: &Run) -> Option<String> {
    let TipShape::Cone { half_angle } = run.settings.tip else { return None };
    let mm = 0.5 * run.settings.diameter_mm / half_angle.tan();
    (mm > run.settings.diameter_mm).then(|| format!(", or a conical tip as long as {mm:.0} mm,"))
}

/// The structure around a point; `None` where there are several, or where their walls are near, or in a broken mesh.
fn in_the_midst(mesh: &TetMesh, p: Point<Patient>) -> Option<Option<Structure>> {
    let locator = TetLocator::new(mesh).ok()?;
    let at = |q| locator.locate(q).and_then(|l| Structure::from_label(mesh.labels[l.tet]));
    let steps = [[CLEAR, 0.0, 0.0], [0.0, CLEAR, 0.0], [0.0, 0.0, CLEAR]].map(|[x, y, z]| Vector::new(x, y, z));
    let here = at(p);
    steps.into_iter().all(|s| at(p + s) == here && at(p - s) == here).then_some(here)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tip_amid_a_structure_is_told_from_one_at_a_wall() {
        // Two elements on either side of the plane x = 0.
        let vertices = [[0.0, -9.0, -9.0], [0.0, 9.0, -9.0], [0.0, 0.0, 9.0], [-9.0, 0.0, 0.0], [9.0, 0.0, 0.0]];
        let [brain, fluid] = [Structure::Brain, Structure::ThirdVentricle];
        let mesh = TetMesh {
            vertices: vertices.map(Point::from_array).to_vec(),
            tets: vec![[0, 2, 1, 3], [0, 1, 2, 4]],
            labels: [brain, fluid].map(|s| u16::from(s.label())).to_vec(),
        };
        let at = |x: f64| in_the_midst(&mesh, Point::new(x, 0.0, -2.0));
        assert_eq!([at(-1.0), at(-0.3), at(1.0), at(20.0)], [Some(Some(brain)), None, Some(Some(fluid)), Some(None)]);
    }
}
