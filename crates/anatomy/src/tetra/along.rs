//! Edges along a planned path.

use super::size::CORE;
use super::start::SPLIT;
use monro_geometry::d3::D3;
use monro_geometry::{Patient, Point};

/// Edge wanted along the path over that of as many elements all alike: 1.5 mm in a brain of 1.3 litres of 37,336.
/// Labels to be fine around are often thin, and take far shorter edges than the count affords all around them: these were 2.5 to
/// 3.7 mm where a path was left with 3 to 7 mm, and elements twice as long as a catheter is thick hardly dimple under its tip.
const PART: f64 = 0.22;
/// Shorter ones than these, mm, are made where the count affords them all around: half as long as a catheter is thick.
const LEAST: f64 = 1.5;
/// A cell that the path goes through is split when longer than so many of those: cells halve, so edges become one to two times as
/// long as wanted, 2.3 to 2.9 mm on average in heads and phantoms.
const SPLIT_ON: f64 = 2.27;
/// Elements more for each such edge of a path's length (measured on heads), and the part of all that they may be: 612 are the
/// outer surface and coarse regions.
const PER_EDGE: f64 = 23.0;
const MOST_TAKEN: f64 = 0.2;
/// Volume of a body-centred tetrahedron over the cube of its mean edge.
const VOLUME_PER_CUBE: f64 = 0.106;

/// How long edges are to be around a path, however little of the count thin labels leave.
#[derive(Debug, Clone, Copy)]
pub(super) struct Along {
    ends: [Point<Patient>; 2],
    /// Edge on the path, mm.
    edge: f64,
    /// Edges are alike up to this distance from it, mm,
    core: f64,
    /// and grow by so many mm a mm beyond.
    growth: f64,
}

impl Along {
    /// Around a path through a region of so many mm3 that is to have so many elements; `None` where there are too few for it.
    /// Lengths are in units of so many mm.
    pub(super) fn new(ends: [Point<Patient>; 2], volume: f64, elements: usize, unit: f64, growth: f64) -> Option<Self> {
        let even = (volume / (VOLUME_PER_CUBE * elements as f64)).cbrt();
        let (edge, core) = ((PART * even).max(LEAST * unit), CORE * unit);
        let taken = PER_EDGE * ends[0].distance(ends[1]) / edge;
        (taken < MOST_TAKEN * elements as f64).then_some(Self { ends, edge, core, growth })
    }

    /// Edge wanted at a place, mm.
    pub(super) fn edge_at(&self, p: D3) -> f64 {
        let p = Point::from_array(p);
        let distance = p.distance(p.nearest_on_segment(self.ends[0], self.ends[1]));
        self.edge + self.growth * (distance - self.core).max(0.0)
    }

    /// Whether a cell of the lattice, given by its lowest corner, centre and length, is to be split for the path: its middle does
    /// not tell where it is large.
    pub(super) fn is_coarse(&self, low: D3, centre: D3, length: f64) -> bool {
        let on_it = || length > SPLIT_ON * self.edge && self.meets(low, low.map(|x| x + length));
        length > SPLIT * self.edge_at(centre) || on_it()
    }

    /// Whether some of the path, or what is as fine around it, may lie in a box.
    fn meets(&self, low: D3, high: D3) -> bool {
        let [from, to] = self.ends.map(Point::to_array);
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for a in 0..3 {
            let (low, high) = (low[a] - self.core - from[a], high[a] + self.core - from[a]);
            let along = to[a] - from[a];
            if along == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let (x, y) = (low / along, high / along);
            enter = enter.max(x.min(y));
            leave = leave.min(x.max(y));
        }
        enter <= leave
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(from: D3, to: D3) -> Along {
        Along::new([from, to].map(Point::from_array), 1.3e6, 37_336, 1.0, 1.4).expect("enough elements")
    }

    #[test]
    fn the_path_took_elements_from_the_outer_surface_where_there_were_few() {
        let ends = [[0.0, 0.0, 70.0], [0.0; 3]].map(Point::from_array);
        let is_made = |elements| Along::new(ends, 1.3e6, elements, 1.0, 1.4).is_some();
        assert!(is_made(5_824) && !is_made(612));
    }

    #[test]
    fn edges_grow_from_the_path_on() {
        let along = along([0.0, 0.0, 70.0], [0.0; 3]);
        let on_it = along.edge_at([0.0, 0.6, 30.0]);
        assert!((on_it - 1.52).abs() < 0.01, "{on_it}");
        let off = [along.edge_at([3.0, 0.0, 30.0]), along.edge_at([0.0, 0.0, -3.0])];
        assert!(off.iter().all(|e| (e - on_it - 2.0 * 1.4).abs() < 1e-12), "{off:?}");
    }

    #[test]
    fn more_elements_make_no_edges_along_the_path_that_are_far_shorter_than_a_catheter_is_thick() {
        let ends = [[0.0, 0.0, 70.0], [0.0; 3]].map(Point::from_array);
        let edge = |unit| Along::new(ends, 1.3e6, 500_000, unit, 1.4).expect("enough elements").edge_at([0.0; 3]);
        assert_eq!((edge(1.0), edge(0.5)), (1.5, 0.75));
    }

    #[test]
    fn a_large_cell_that_the_path_clips_at_a_corner_is_split() {
        let along = along([-1.0, 9.0, 4.0], [9.0, -1.0, 4.0]);
        // The path is 5.7 mm off the middle of the first, and 1.4 mm off the corner of the second.
        let coarse = |low: D3, length: f64| along.is_coarse(low, low.map(|x| x + 0.5 * length), length);
        assert!(coarse([0.0; 3], 8.0) && coarse([4.0, 4.0, 0.0], 16.0));
        assert!(!coarse([7.0, 7.0, 0.0], 4.0) && !coarse([3.0, 3.0, 3.0], 1.9));
    }

    #[test]
    fn a_path_along_an_axis_or_of_no_length_meets_what_it_lies_in() {
        for from in [[2.0, 2.0, 50.0], [2.0, 2.0, 2.0]] {
            let along = along(from, [2.0; 3]);
            assert!(along.meets([0.0; 3], [4.0; 3]));
            assert!(!along.meets([4.0, 0.0, 0.0], [8.0, 4.0, 4.0]));
            assert_eq!(along.meets([0.0, 0.0, 40.0], [4.0, 4.0, 44.0]), from[2] == 50.0);
        }
    }
}
