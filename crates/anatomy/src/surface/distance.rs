//! Exact Euclidean distance transforms by lower envelopes of parabolas (Felzenszwalb and Huttenlocher 2012).

use rayon::prelude::*;

/// Stands for "no site in this line"; squares of real distances stay far below.
const FAR: f32 = 1e20;

/// Lines that are looked at together, as they lie side by side.
const TILE: usize = 16;

/// Squared distance (mm2) of each cell of a `dims` array (first axis fastest) to the nearest cell with a site, with the
/// given cell spacing in mm. All `1e20` when there is no site.
pub(crate) fn squared_distance(sites: &[bool], dims: [usize; 3], spacing: [f64; 3]) -> Vec<f32> {
    let mut d = vec![FAR; sites.len()];
    if dims[0] > 0 {
        let rows = d.par_chunks_mut(dims[0]).zip(sites.par_chunks(dims[0]));
        rows.with_min_len(64).for_each(|(d, sites)| along_row(d, sites, spacing[0]));
    }
    for axis in 1..3 {
        if dims[axis] > 1 {
            pass(&mut d, dims, axis, spacing[axis]);
        }
    }
    d
}

/// Along a row: from the site before and from the one behind.
fn along_row(d: &mut [f32], sites: &[bool], spacing: f64) {
    let squared = |cells: usize| ((cells * cells) as f64 * spacing * spacing) as f32;
    let mut last = None;
    for (i, &site) in sites.iter().enumerate() {
        last = if site { Some(i) } else { last };
        d[i] = last.map_or(FAR, |l| squared(i - l));
    }
    let mut next = None;
    for (i, &site) in sites.iter().enumerate().rev() {
        next = if site { Some(i) } else { next };
        d[i] = next.map_or(d[i], |n| d[i].min(squared(n - i)));
    }
}

fn pass(d: &mut [f32], dims: [usize; 3], axis: usize, spacing: f64) {
    let inner: usize = dims[..axis].iter().product();
    let n = dims[axis];
    // One block holds all lines of this axis through one plane (or the whole array for the last axis).
    d.par_chunks_mut(inner * n).for_each(|chunk| {
        let mut scratch = Scratch::new(n);
        let mut tile = vec![0f32; TILE * n];
        for first in (0..inner).step_by(TILE) {
            let lines = TILE.min(inner - first);
            for i in 0..n {
                tile[i * TILE..][..lines].copy_from_slice(&chunk[i * inner + first..][..lines]);
            }
            for line in 0..lines {
                scratch.line.iter_mut().zip(tile[line..].iter().step_by(TILE)).for_each(|(l, &v)| *l = f64::from(v));
                if scratch.transform(spacing) {
                    let out = scratch.out.iter();
                    tile[line..].iter_mut().step_by(TILE).zip(out).for_each(|(v, &o)| *v = o as f32);
                }
            }
            for i in 0..n {
                chunk[i * inner + first..][..lines].copy_from_slice(&tile[i * TILE..][..lines]);
            }
        }
    });
}

struct Scratch {
    line: Vec<f64>,
    out: Vec<f64>,
    /// Positions of the parabolas of the envelope, their heights at 0 in squared cells, and where each begins to be lowest.
    site: Vec<usize>,
    height: Vec<f64>,
    begin: Vec<f64>,
}

impl Scratch {
    fn new(n: usize) -> Self {
        let empty = || Vec::with_capacity(n);
        Self { line: vec![0.0; n], out: vec![0.0; n], site: Vec::with_capacity(n), height: empty(), begin: empty() }
    }

    /// Whether there was any site.
    fn transform(&mut self, spacing: f64) -> bool {
        let far = f64::from(FAR);
        let s2 = spacing * spacing;
        self.site.clear();
        self.height.clear();
        self.begin.clear();
        for q in 0..self.line.len() {
            // A site between two others is the nearest to none but itself.
            if self.line[q] >= far || self.line[q.saturating_sub(1)..self.line.len().min(q + 2)] == [0.0; 3] {
                continue;
            }
            let height = self.line[q] / s2 + (q * q) as f64;
            let mut from = f64::NEG_INFINITY;
            while let (Some(&p), Some(&below)) = (self.site.last(), self.height.last()) {
                from = (height - below) / (2 * (q - p)) as f64;
                if from > self.begin[self.begin.len() - 1] {
                    break;
                }
                self.site.pop();
                self.height.pop();
                self.begin.pop();
                from = f64::NEG_INFINITY;
            }
            self.site.push(q);
            self.height.push(height);
            self.begin.push(from);
        }
        if self.site.is_empty() {
            return false;
        }
        let mut k = 0;
        for (i, o) in self.out.iter_mut().enumerate() {
            while k + 1 < self.site.len() && self.begin[k + 1] < i as f64 {
                k += 1;
            }
            let p = self.site[k];
            *o = if self.line[i] == 0.0 { 0.0 } else { (i as f64 - p as f64).powi(2) * s2 + self.line[p] };
        }
        true
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
