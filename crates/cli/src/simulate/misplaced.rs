//! A tip that is not where it is counted to be: walls yield at what materials say, and the mesh knows where they are.

use super::Run;
use monro_geometry::{Patient, Point, Structure, TetLocator, TetMesh, Vector};
use monro_session::Frame;

/// A tip with the same structure so far around it, mm, touches no wall.
const CLEAR: f64 = 0.5;

/// Moments at which the tip lies in the midst of another structure than the one that it is counted to.
pub(super) struct Misplaced<'a> {
    moments: usize,
    of: usize,
    first: (&'a Frame, Option<Structure>),
    /// Whether it is so at the end.
    pub(super) at_end: bool,
}

impl<'a> Misplaced<'a> {
    /// Of the meshes that were kept; `None` where all agree, and in paper mode, whose forces pierce nothing. One on the way is
    /// none: just before a wall yields, a tip may be through by a millimetre.
    pub(super) fn of(run: &'a Run) -> Option<Self> {
        if !run.has_units() {
            return None;
        }
        let frame = |time_s: f64| run.rows.iter().map(|r| &r.frame).find(|f| f.time_s >= time_s);
        let looked = run.snapshots.iter().map(|s| frame(s.time_s).and_then(|f| Some((f, elsewhere(f, &s.mesh)?))));
        let looked: Vec<_> = looked.collect();
        let found = Self {
            moments: looked.iter().flatten().count(),
            of: looked.len(),
            first: *looked.iter().flatten().next()?,
            at_end: looked.last().is_some_and(Option::is_some),
        };
        (found.at_end || found.moments > 1).then_some(found)
    }

    /// In words.
    pub(super) fn words(&self) -> String {
        let Self { moments, of, first: (frame, there), .. } = self;
        let name = |s: Option<Structure>| s.map_or("no simulated tissue".into(), Structure::words);
        format!(
            "In {moments} of the {of} meshes looked at the tip lies in another structure than the one it is counted to (the first \
             at {:.1} mm under the skin: in {} by the mesh, in {} by the walls that have yielded): the materials' puncture_force_mn \
             and puncture_depth_mm let a wall yield that is only touched, or none that is gone through. Do not rely on what is \
             said of the structures at the tip, nor on CSF.",
            frame.depth_mm,
            name(*there),
            name(frame.at_tip)
        )
    }
}

/// The structure that the tip lies in the midst of, where that is not the one that it is counted to.
fn elsewhere(frame: &Frame, mesh: &TetMesh) -> Option<Option<Structure>> {
    let kind = |s: Option<Structure>| s.map(Structure::is_ventricle);
    let there = in_the_midst(mesh, frame.tip)?;
    (kind(there) != kind(frame.at_tip)).then_some(there)
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
