//! Paths that leave the simulated tissue: into bone at the base of the skull, or out of the brain on its other side.

use monro_geometry::TetLocator;
use monro_guidance::Plan;

/// The path is looked at in such steps, mm.
const STEP_MM: f64 = 0.25;
/// Less than this outside is where a surface is made of chords, or a furrow, mm.
const LEAST_MM: f64 = 3.0;

/// A path that leaves the tissue at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Beyond {
    /// 0 is that of the plan, then those beside.
    number: usize,
    /// Depths under its entry, mm, from which to which it is outside.
    outside_mm: [f64; 2],
}

impl Beyond {
    /// The first of some paths, that of the plan first, that leaves the tissue.
    pub(super) fn first<'a>(locator: &TetLocator, plans: impl Iterator<Item = &'a Plan>) -> Option<Self> {
        let mut all = plans.enumerate();
        all.find_map(|(number, plan)| Some(Self { number, outside_mm: outside(locator, plan)? }))
    }

    pub(super) fn words(self) -> String {
        let Self { number, outside_mm: [from, to] } = self;
        let which = if number == 0 { "The path".to_owned() } else { format!("The path of catheter {number} beside") };
        format!(
            "{which} is outside of the simulated tissue from {from:.1} to {to:.1} mm under its entry, after it was within: there is bone, \
             or nothing of the brain, neither of which resists here. Look at where it leads."
        )
    }
}

/// From which depth to which a path that has come into the tissue is out of it again, mm.
fn outside(locator: &TetLocator, plan: &Plan) -> Option<[f64; 2]> {
    let places = plan.every(STEP_MM).map(|(depth, at)| (depth, locator.locate(at).is_some()));
    let within: Vec<(f64, bool)> = places.skip_while(|(_, within)| !within).collect();
    let runs = within.chunk_by(|a, b| a.1 == b.1).filter(|run| !run[0].1);
    let long = |run: &&[(f64, bool)]| run.len() as f64 * STEP_MM > LEAST_MM;
    runs.into_iter().find(long).map(|run| [run[0].0, run[run.len() - 1].0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Point, TetMesh};
    use monro_guidance::Side;

    #[test]
    fn a_path_out_at_the_far_side_is_told_and_a_furrow_is_not() {
        // Two large tetrahedra along the z axis with room between them.
        let at =
            |z: f64| [[-50.0, -50.0, z], [50.0, -50.0, z], [0.0, 80.0, z], [0.0, 0.0, z - 40.0]].map(Point::from_array);
        let mesh = |gap: f64| TetMesh {
            vertices: [at(0.0), at(-40.0 - gap)].concat(),
            tets: vec![[0, 2, 1, 3], [4, 6, 5, 7]],
            labels: vec![4; 2],
        };
        let plan = |length: f64| {
            Plan::new(Side::Right, Point::new(0.1, 0.1, 20.0), Point::new(0.1, 0.1, 20.0 - length)).expect("a plan")
        };
        let found = |gap: f64, length: f64| {
            let mesh = mesh(gap);
            outside(&TetLocator::new(&mesh).expect("a mesh"), &plan(length))
        };
        assert_eq!(found(2.0, 90.0), None, "a furrow");
        let [from, to] = found(12.0, 90.0).expect("a gap");
        assert!((from - 60.0).abs() < 1.0 && (to - 72.0).abs() < 1.0, "{from} {to}");
        let [from, to] = found(2.0, 130.0).expect("out at the far side");
        assert!((from - 102.0).abs() < 1.0 && (to - 130.0).abs() < 1.0, "{from} {to}");
    }
}
