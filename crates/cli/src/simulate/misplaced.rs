//! A tip that is not where it is counted to be: walls yield at what materials say, and the mesh knows where they are.

use super::Run;
use monro_geometry::{Patient, Point, Structure, TetMesh, Vector};
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

/// The structure around a point; `None` where there are several, or where their walls are near.
fn in_the_midst(mesh: &TetMesh, p: Point<Patient>) -> Option<Option<Structure>> {
    let here = structure_at(mesh, p);
    let same = |axis: usize| {
        let mut step = [0.0; 3];
        step[axis] = CLEAR;
        let [x, y, z] = step;
        let step = Vector::new(x, y, z);
        [p + step, p - step].into_iter().all(|q| structure_at(mesh, q) == here)
    };
    (0..3).all(same).then_some(here)
}

/// The structure at a point, by brute force: some meshes of a run are looked at, at a few points each.
fn structure_at(mesh: &TetMesh, p: Point<Patient>) -> Option<Structure> {
    let holds = |t: &usize| {
        let [a, b, c, d] = mesh.corners(*t);
        let side = |a: Point<Patient>, b: Point<Patient>, c: Point<Patient>| (b - a).cross(c - a).dot(p - a);
        let sides = [side(b, d, c), side(a, c, d), side(a, d, b), side(a, b, c)];
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    };
    (0..mesh.tets.len()).find(holds).and_then(|t| Structure::from_label(mesh.labels[t]))
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
            tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
            labels: [brain, fluid].map(|s| u16::from(s.label())).to_vec(),
        };
        let at = |x: f64| in_the_midst(&mesh, Point::new(x, 0.0, -2.0));
        assert_eq!([at(-1.0), at(-0.3), at(1.0), at(20.0)], [Some(Some(brain)), None, Some(Some(fluid)), Some(None)]);
    }
}
