//! The one conversion to HU, and the count of what it had to change.

/// HU of air, and of everything outside the scan.
pub(crate) const AIR: i16 = -1024;

/// What the conversion to HU had to change.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HuNotes {
    /// Values seen.
    pub count: u64,
    /// Values below -1024, set to -1024.
    pub below: u64,
    /// The lowest of them.
    pub lowest: f64,
    /// Values above 32767, set to 32767.
    pub above: u64,
    /// NaN and infinite values, set to -1024.
    pub not_finite: u64,
    /// Padding outside the reconstructed field, set to -1024.
    pub padding: u64,
}

impl HuNotes {
    /// The HU of one value; counts what it changes.
    #[inline]
    pub(crate) fn hu(&mut self, value: f64) -> i16 {
        self.count += 1;
        // Half away from zero, as `round`, but without the library call of the baseline target.
        let rounded = (value + 0.5f64.copysign(value)).trunc();
        if rounded >= f64::from(AIR) && rounded <= f64::from(i16::MAX) {
            return rounded as i16;
        }
        self.odd(value)
    }

    #[cold]
    fn odd(&mut self, value: f64) -> i16 {
        if !value.is_finite() {
            self.not_finite += 1;
            AIR
        } else if value < 0.0 {
            self.below += 1;
            self.lowest = self.lowest.min(value);
            AIR
        } else {
            self.above += 1;
            i16::MAX
        }
    }

    /// Adds the counts of another part of the scan.
    pub(crate) fn add(&mut self, o: &Self) {
        self.count += o.count;
        self.below += o.below;
        self.lowest = self.lowest.min(o.lowest);
        self.above += o.above;
        self.not_finite += o.not_finite;
        self.padding += o.padding;
    }

    /// Sentences for the user; none when nothing was changed.
    pub fn warnings(&self) -> Vec<String> {
        let share = |n: u64| 100.0 * n as f64 / self.count.max(1) as f64;
        let mut out = Vec::new();
        if self.below > 0 {
            let (n, p, low) = (self.below, share(self.below), self.lowest);
            out.push(format!("{n} voxels ({p:.1} %) below -1024 HU, the lowest {low:.0}, were set to -1024"));
        }
        if self.above > 0 {
            out.push(format!("{} voxels above 32767 HU were set to 32767", self.above));
        }
        if self.not_finite > 0 {
            let (n, p) = (self.not_finite, share(self.not_finite));
            out.push(format!("{n} voxels ({p:.1} %) are not finite numbers and were set to -1024 HU"));
        }
        if self.padding > 0 {
            let (n, p) = (self.padding, share(self.padding));
            out.push(format!("{n} padding voxels ({p:.1} %) were set to -1024 HU"));
        }
        out
    }
}
