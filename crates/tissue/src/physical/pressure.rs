//! The nodal pressures of [`Descent`]: an augmented Lagrangian of the volume of each patch.

use super::descent::{Descent, DescentScratch};
use super::region::Active;
use crate::vec3::{six_volume, xyz};

impl Descent {
    /// Growth of all elements and patches at the current positions, and the pressures that follow from it.
    #[inline(always)]
    pub(super) fn measure(&self, positions: &[[f32; 4]], nodal: &[f32], scratch: &mut DescentScratch) {
        scratch.dilation.clear();
        scratch.dilation.resize(self.patch_volume.len(), 0.0);
        scratch.growth.clear();
        for ((tet, patch), rest) in self.tets.iter().zip(&self.patch).zip(&self.tet_rest) {
            let grown = six_volume(tet.map(|v| xyz(positions[v as usize]))) - rest;
            scratch.growth.push(grown);
            patch.iter().for_each(|&p| scratch.dilation[p as usize] += grown);
        }
        scratch.total.clear();
        let total = nodal.iter().enumerate().map(|(k, p)| p + self.patch_rate[k] * scratch.dilation[k]);
        scratch.total.extend(total);
        for t in 0..self.tets.len() {
            self.spread(t, scratch);
        }
    }

    /// Measures the active elements anew and lets the pressures of their patches take the next step of the multiplier
    /// method, `p <- (p + r (J - 1)) / (1 + r / k)`, at rest in itself when `p = k (J - 1)`.
    #[inline(always)]
    pub(super) fn update(
        &self,
        positions: &[[f32; 4]],
        nodal: &mut [f32],
        active: &Active,
        scratch: &mut DescentScratch,
    ) {
        for &t in &active.tets {
            let t = t as usize;
            let grown = six_volume(self.tets[t].map(|v| xyz(positions[v as usize]))) - self.tet_rest[t];
            let change = grown - scratch.growth[t];
            scratch.growth[t] = grown;
            self.patch[t].iter().for_each(|&p| scratch.dilation[p as usize] += change);
        }
        for &k in &active.patches {
            let k = k as usize;
            let step = self.patch_rate[k] * scratch.dilation[k];
            nodal[k] = (nodal[k] + step) * self.patch_share[k];
            scratch.total[k] = nodal[k] + step;
        }
        for &t in &active.tets {
            self.spread(t as usize, scratch);
        }
    }

    /// Pressure of an element: the mean of its patches, less what the element's own change from now on will add again.
    #[inline(always)]
    fn spread(&self, t: usize, scratch: &mut DescentScratch) {
        let mean = 0.25 * self.patch[t].iter().map(|&p| scratch.total[p as usize]).sum::<f32>();
        let element = &mut scratch.elements[t];
        element[0] = mean - scratch.growth[t] * self.tet_penalty[t] - element[1];
    }
}
