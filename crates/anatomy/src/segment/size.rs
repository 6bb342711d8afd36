//! How large the space inside the skull is: whether the scan's spacing can be right.

use super::error::SegmentError;
use crate::image::Mask;

/// What is usual, ml: a child of half a year has 700, adults have 1000 to 1850; beyond are a few with large heads.
const USUAL_ML: [f64; 2] = [650.0, 2050.0];
/// Adults have no less, ml; what is measured along their skin is not where it should be on a child.
const ADULT_ML: f64 = 1000.0;
/// No skull holds more, ml: the largest of children with a hydrocephalus.
const MOST_ML: f64 = 4500.0;
/// Height of that space by the geometric mean of its length and width: 0.8 to 1.0 in whole heads, however they are nodded.
const USUAL_HEIGHT: [f64; 2] = [0.65, 1.25];

/// The space inside the skull.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Size {
    ml: f64,
    /// Width, length and height along the patient's axes, mm.
    extent_mm: [f64; 3],
}

impl Size {
    /// Of a mask on a raster along the patient's axes with voxels of `step` mm.
    pub(crate) fn of(space: &Mask, step: f64) -> Self {
        let extent_mm = space
            .bounds(0)
            .map_or([0.0; 3], |(low, high)| core::array::from_fn(|a| high[a].saturating_sub(low[a]) as f64 * step));
        Self { ml: space.count() as f64 * step.powi(3) / 1000.0, extent_mm }
    }

    /// The ellipse of its length and height, mm2: about its largest sagittal section.
    pub(crate) fn sagittal_mm2(self) -> f64 {
        core::f64::consts::FRAC_PI_4 * self.extent_mm[1] * self.extent_mm[2]
    }

    /// Refuses what no head has.
    ///
    /// # Errors
    /// [`SegmentError::TooLarge`].
    pub(crate) fn check(self) -> Result<(), SegmentError> {
        let Self { ml, extent_mm } = self;
        if ml > MOST_ML { Err(SegmentError::TooLarge { ml, most_ml: MOST_ML, extent_mm }) } else { Ok(()) }
    }

    /// A sentence about what is unusual. Of a head that is not shown whole, small and low says nothing.
    pub(crate) fn finding(self, whole: bool) -> Option<String> {
        let [width, length, height] = self.extent_mm;
        let ratio = height / (width * length).sqrt();
        let outside = |value: f64, [low, high]: [f64; 2]| value > high || whole && value < low;
        let told = |what: String| {
            Some(format!(
                "{what}; it measures {width:.0} x {length:.0} x {height:.0} mm (width, length, height): is the spacing in the \
                 header right? Sizes, distances and the plan are as wrong as it is"
            ))
        };
        if outside(self.ml, USUAL_ML) {
            let [low, high] = USUAL_ML;
            return told(format!(
                "the space inside the skull has {:.0} ml; {low:.0} to {high:.0} ml are usual from a child of half a year to a \
                 large adult",
                self.ml
            ));
        }
        if outside(ratio, USUAL_HEIGHT) {
            let [low, high] = USUAL_HEIGHT;
            return told(format!(
                "the space inside the skull is {ratio:.2} times as high as it is long and wide on average; {low} to {high} is \
                 usual"
            ));
        }
        (whole && self.ml < ADULT_ML).then(|| {
            format!(
                "the space inside the skull has {:.0} ml, as a child's: Kocher's point is set as on adults (110 mm from the \
                 nasion, 30 mm from the midline); look at the entry, or give one with --plan FILE.mrk.json",
                self.ml
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of these sides, mm, within a raster of 2 mm.
    fn space(sides: [usize; 3]) -> Size {
        let mut mask = Mask::filled([150, 150, 150], false);
        for n in 0..mask.data.len() {
            let v = mask.voxel(n);
            mask.data[n] = (0..3).all(|a| v[a] >= 3 && v[a] < 3 + sides[a] / 2);
        }
        Size::of(&mask, 2.0)
    }

    #[test]
    fn a_spacing_1_3_times_too_large_gave_a_case_without_a_word() {
        assert_eq!(space([110, 130, 104]).finding(true), None);
        let told = space([144, 170, 136]).finding(true).expect("a finding");
        assert!(told.contains("3329 ml") && told.contains("144 x 170 x 136 mm") && told.contains("spacing"), "{told}");
    }

    #[test]
    fn a_stretched_or_flattened_stack_of_usual_volume_gave_a_case_without_a_word() {
        for height in [150, 60] {
            let told = space([100, 120, height]).finding(true).expect("a finding");
            assert!(told.contains("as high as it is long"), "{told}");
        }
    }

    #[test]
    fn a_head_that_is_cut_is_not_called_too_small() {
        assert_eq!(space([110, 130, 40]).finding(false), None);
        assert!(space([110, 130, 40]).finding(true).is_some());
    }

    #[test]
    fn an_entry_on_a_childs_head_was_that_of_an_adult_without_a_word() {
        let told = space([90, 106, 86]).finding(true).expect("a finding");
        assert!(told.contains("as a child's") && told.contains("Kocher"), "{told}");
        assert_eq!(space([90, 106, 86]).finding(false), None);
    }

    #[test]
    fn what_no_skull_holds_is_refused() {
        assert!(space([144, 170, 136]).check().is_ok());
        assert!(matches!(space([200, 200, 200]).check(), Err(SegmentError::TooLarge { .. })));
    }
}
