//! Exact Euclidean distance transforms by lower envelopes of parabolas (Felzenszwalb and Huttenlocher 2012).

use rayon::prelude::*;

/// Stands for "no site in this line"; squares of real distances stay far below.
const FAR: f32 = 1e20;

/// Squared distance (mm2) of each cell of a `dims` array (first axis fastest) to the nearest cell with a site, with the
/// given cell spacing in mm. All `1e20` when there is no site.
pub(crate) fn squared_distance(sites: &[bool], dims: [usize; 3], spacing: [f64; 3]) -> Vec<f32> {
    let mut d: Vec<f32> = sites.iter().map(|&s| if s { 0.0 } else { FAR }).collect();
    for axis in 0..3 {
        if dims[axis] > 1 {
            pass(&mut d, dims, axis, spacing[axis]);
        }
    }
    d
}

fn pass(d: &mut [f32], dims: [usize; 3], axis: usize, spacing: f64) {
    let inner: usize = dims[..axis].iter().product();
    let block = inner * dims[axis];
    // One block holds all lines of this axis through one plane (or the whole array for the last axis).
    d.par_chunks_mut(block).for_each(|chunk| {
        let mut scratch = Scratch::new(dims[axis]);
        for line in 0..inner {
            for (i, value) in scratch.line.iter_mut().enumerate() {
                *value = f64::from(chunk[line + i * inner]);
            }
            scratch.transform(spacing);
            for (i, &value) in scratch.out.iter().enumerate() {
                chunk[line + i * inner] = value as f32;
            }
        }
    });
}

struct Scratch {
    line: Vec<f64>,
    out: Vec<f64>,
    /// Positions of the parabolas of the envelope and where each begins to be lowest.
    site: Vec<usize>,
    begin: Vec<f64>,
}

impl Scratch {
    fn new(n: usize) -> Self {
        Self { line: vec![0.0; n], out: vec![0.0; n], site: Vec::with_capacity(n), begin: Vec::with_capacity(n) }
    }

    fn transform(&mut self, spacing: f64) {
        let far = f64::from(FAR);
        let s2 = spacing * spacing;
        self.site.clear();
        self.begin.clear();
        for q in 0..self.line.len() {
            if self.line[q] >= far {
                continue;
            }
            let height = |i: usize, f: &[f64]| f[i] / s2 + (i * i) as f64;
            let mut from = f64::NEG_INFINITY;
            while let Some(&p) = self.site.last() {
                from = (height(q, &self.line) - height(p, &self.line)) / (2 * (q - p)) as f64;
                if from > self.begin[self.begin.len() - 1] {
                    break;
                }
                self.site.pop();
                self.begin.pop();
                from = f64::NEG_INFINITY;
            }
            self.site.push(q);
            self.begin.push(from);
        }
        let mut k = 0;
        for (i, o) in self.out.iter_mut().enumerate() {
            while k + 1 < self.site.len() && self.begin[k + 1] < i as f64 {
                k += 1;
            }
            *o = self.site.get(k).map_or(far, |&p| (i as f64 - p as f64).powi(2) * s2 + self.line[p]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_brute_force(sites in proptest::collection::vec(proptest::bool::weighted(0.1), 5 * 6 * 7)) {
            let dims = [5, 6, 7];
            let spacing = [0.5, 1.0, 2.5];
            let at = |n: usize| [n % 5, n / 5 % 6, n / 30];
            let d = squared_distance(&sites, dims, spacing);
            for (n, &found) in d.iter().enumerate() {
                let brute = (0..sites.len()).filter(|&m| sites[m]).map(|m| {
                    (0..3).map(|a| ((at(n)[a] as f64 - at(m)[a] as f64) * spacing[a]).powi(2)).sum::<f64>()
                }).fold(f64::from(FAR), f64::min);
                prop_assert!((f64::from(found) - brute).abs() <= 1e-5 * brute, "{found} {brute}");
            }
        }
    }
}
