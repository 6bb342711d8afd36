//! Where the scan ends before the head does, other than at the neck.

use super::cavity::Cavity;
use super::cut::LAST_LAYERS;
use super::error::SegmentError;
use super::size::Size;
use super::working::Working;
use crate::image::Mask;

/// Bone at the top end of the scan over less than this is a bump under thin skin, mm2.
const LEAST_BONE_MM2: f64 = 300.0;
/// The brain at another end over more than this is told, mm2.
const LEAST_BRAIN_MM2: f64 = 300.0;
/// Over more than this, it is more than a cap that is missing, mm2.
const MUCH_BRAIN_MM2: f64 = 2000.0;
const DOUBTFUL: &str = ". Landmarks and the sides of the ventricles are not to be relied on; take a scan of the whole head, or look \
                        closely and give labels and path with --labels and --plan";
/// A section of the brain at its side is no more than 3 to 4 cm from the midplane, within reach of a lateral ventricle, when it has
/// this part of the ellipse of the brain's length and height: no ventricle can be told from its neighbour then.
const MOST_OF_ELLIPSE: f64 = 0.6;

/// Areas over which the scan's ends cut the head, mm2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ends {
    /// Of brain at the patient's right and left.
    sides: [f64; 2],
    /// Of brain at the front and at the back.
    front_back: [f64; 2],
    /// Of bone at the top.
    top: f64,
    /// The most of brain at a side that leaves both lateral ventricles in the scan.
    most_at_side: f64,
}

impl Ends {
    /// Looks at what the scan shows last along each line of the working raster; `bone` by its threshold, HU. Not smoothed: smoothing
    /// takes the end of the scan for air, and so did the search for the brain.
    pub(crate) fn of(working: &Working, (cavity, size): (&Cavity, Size), bone: f32) -> Self {
        let mm2 = working.lattice.step * working.lattice.step;
        let shown = working.nodata.not();
        let brain = |axis, forwards| lines_ending_in(&cavity.mask, &shown, (axis, forwards), LAST_LAYERS) as f64 * mm2;
        let hard = working.hu.map(|v| v > bone);
        Self {
            sides: [brain(0, false), brain(0, true)],
            front_back: [brain(1, false), brain(1, true)],
            top: lines_ending_in(&hard, &shown, (2, true), 0) as f64 * mm2,
            most_at_side: MOST_OF_ELLIPSE * size.sagittal_mm2(),
        }
    }

    /// Refuses a head of which a side is missing.
    ///
    /// # Errors
    /// [`SegmentError::SideCut`].
    pub(crate) fn check(&self) -> Result<(), SegmentError> {
        let cut = ["right", "left"].into_iter().zip(self.sides).find(|(_, mm2)| *mm2 > self.most_at_side);
        cut.map_or(Ok(()), |(side, mm2)| {
            Err(SegmentError::SideCut { side, area_cm2: mm2 / 100.0, most_cm2: self.most_at_side / 100.0 })
        })
    }

    /// Area over which bone is at the top end of the scan, mm2; 0 where it is small.
    pub(crate) fn open_top(&self) -> f64 {
        if self.top > LEAST_BONE_MM2 { self.top } else { 0.0 }
    }

    /// Whether an end other than the top cuts the brain.
    pub(crate) fn cut(&self) -> bool {
        self.sides.iter().chain(&self.front_back).any(|mm2| *mm2 > LEAST_BRAIN_MM2)
    }

    /// Sentences about ends that cut the brain.
    pub(crate) fn findings(&self) -> Vec<String> {
        let all = ["patient's right", "patient's left", "front", "back"].into_iter();
        let areas = self.sides.into_iter().chain(self.front_back);
        let told = |(end, mm2): (&str, f64)| {
            let much = if mm2 > MUCH_BRAIN_MM2 { DOUBTFUL } else { "" };
            let cm2 = mm2 / 100.0;
            format!("the head is cut at the {end}: the brain reaches that end of the scan over {cm2:.0} cm2{much}")
        };
        all.zip(areas).filter(|(_, mm2)| *mm2 > LEAST_BRAIN_MM2).map(told).collect()
    }
}

/// Number of lines along an axis, followed forwards or not, whose last shown voxel or one of `layers` before it is in the mask.
fn lines_ending_in(mask: &Mask, shown: &Mask, (axis, forwards): (usize, bool), layers: usize) -> usize {
    let dims = mask.dims;
    let stride = [1, dims[0], dims[0] * dims[1]][axis];
    let starts = (0..mask.data.len()).filter(|&n| mask.voxel(n)[axis] == 0);
    let ends_in = |start: usize| {
        let at = |step: usize| start + stride * if forwards { dims[axis] - 1 - step } else { step };
        let first = (0..dims[axis]).find(|&step| shown.data[at(step)]);
        first.is_some_and(|f| (f..=(f + layers).min(dims[axis] - 1)).any(|step| mask.data[at(step)]))
    };
    starts.filter(|&start| ends_in(start)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(dims: [usize; 3], low: [usize; 3], high: [usize; 3]) -> Mask {
        let mut mask = Mask::filled(dims, false);
        for n in 0..mask.data.len() {
            let v = mask.voxel(n);
            mask.data[n] = (0..3).all(|a| (low[a]..high[a]).contains(&v[a]));
        }
        mask
    }

    #[test]
    fn lines_are_followed_from_either_end_to_what_is_shown_first() {
        let dims = [20, 18, 16];
        let shown = block(dims, [0, 2, 0], [20, 18, 13]);
        let mask = block(dims, [5, 3, 4], [18, 10, 12]);
        let ends = |axis, forwards, layers| lines_ending_in(&mask, &shown, (axis, forwards), layers);
        // Left: begins 5 voxels in. Right: 2 voxels short of the end; front: 1 voxel behind the first that is shown.
        assert_eq!(ends(0, false, 2), 0);
        assert_eq!(ends(0, true, 2), 7 * 8);
        assert_eq!(ends(1, false, 2), 13 * 8);
        assert_eq!(ends(1, true, 2), 0);
        assert_eq!((ends(2, true, 2), ends(2, true, 0)), (13 * 7, 0));
    }

    #[test]
    fn a_head_without_its_side_was_taken() {
        let ends = Ends { sides: [9000.0, 0.0], front_back: [0.0, 500.0], top: 100.0, most_at_side: 8500.0 };
        assert!(matches!(ends.check(), Err(SegmentError::SideCut { side: "right", .. })));
        let ends = Ends { sides: [900.0, 0.0], ..ends };
        let told = ends.findings();
        assert!(ends.check().is_ok() && told.len() == 2, "{told:?}");
        assert!(
            told[0].contains("patient's right") && told[0].contains("9 cm2") && told[1].contains("back"),
            "{told:?}"
        );
        assert_eq!((ends.open_top(), ends.cut()), (0.0, true));
    }
}
