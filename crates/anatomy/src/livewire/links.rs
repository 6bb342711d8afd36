//! The graph of the wire: what it costs to go from a pixel to each of its eight neighbours.

use super::features::{Features, Pixel, turn_of};
use super::training::Training;
use super::{LivewireError, check_option};

/// The eight neighbours as (column, row) steps; direction `d + 4` is opposite to `d`.
pub(super) const STEPS: [[isize; 2]; 8] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];

/// Weights of the features in the cost of a link. They are scaled to sum to one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Zero crossing of the Laplacian, `f_Z`.
    pub crossing: f64,
    /// Gradient magnitude, `f_G`; learnt once there is a path.
    pub gradient: f64,
    /// Direction of the gradient, `f_D`.
    pub direction: f64,
    /// Value on the edge, `f_P`; learnt only.
    pub value: f64,
    /// Value on the brighter side (`f_I` or `f_O`); learnt only.
    pub bright: f64,
    /// Value on the darker side (the other of `f_I` and `f_O`); learnt only.
    pub dark: f64,
    /// Cost of length alone, so that a wire without any edge is straight.
    pub length: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self { crossing: 0.1, gradient: 0.4, direction: 0.1, value: 0.1, bright: 0.15, dark: 0.15, length: 0.01 }
    }
}

impl Weights {
    fn all(&self) -> [f64; 7] {
        [self.crossing, self.gradient, self.direction, self.value, self.bright, self.dark, self.length]
    }

    pub(super) fn check(&self) -> Result<(), LivewireError> {
        for w in self.all() {
            check_option("a weight", w, w.is_finite() && w >= 0.0, "zero or positive")?;
        }
        let sum: f64 = self.all().iter().sum();
        check_option("sum of the weights", sum, sum > 0.0, "positive")
    }
}

/// Link costs, quantised to 1..=255 for the bucket queue; 255 is the diagonal of a pixel without any edge. A zero
/// means that there is no such neighbour.
#[derive(Debug, Clone)]
pub(super) struct Links {
    pub(super) width: usize,
    pub(super) cost: Vec<[u8; 8]>,
}

impl Links {
    /// The weighted sum of costs of MB95 with the learnt features of MB98, times the length of the link. Unlike theirs, a
    /// link costs the mean of both its ends, so that the wire from A to B is also the wire from B to A.
    pub(super) fn new(features: &Features, training: &Training, weights: &Weights) -> Self {
        let scale = 1.0 / weights.all().iter().sum::<f64>();
        let node = node_costs(&features.pixels, training, weights, scale);
        let turns = Turns::new(features.spacing, (weights.direction * scale) as f32);
        let diagonal = features.spacing[0].hypot(features.spacing[1]);
        let length = turns.length.map(|l| (255.0 * l / diagonal) as f32);
        let (w, h) = (features.width, features.height);
        let mut cost = vec![[0u8; 8]; w * h];
        for y in 0..h {
            for x in 0..w {
                let p = y * w + x;
                for d in 0..4 {
                    let [dx, dy] = STEPS[d];
                    if (dx > 0 && x + 1 == w) || (dx < 0 && x == 0) || (dy > 0 && y + 1 == h) {
                        continue;
                    }
                    let q = (p as isize + dy * w as isize + dx) as usize;
                    let turn = turns.cost(d, features.pixels[p].tangent, features.pixels[q].tangent);
                    // The end points' costs are halves already.
                    let c = (length[d] * (node[p] + node[q] + turn) + 0.5).clamp(1.0, 255.0) as u8;
                    cost[p][d] = c;
                    cost[q][d + 4] = c;
                }
            }
        }
        Self { width: w, cost }
    }

    /// The pixel one step in a direction; only for links that exist.
    pub(super) fn step(&self, p: usize, direction: usize) -> usize {
        let [dx, dy] = STEPS[direction];
        (p as isize + dy * self.width as isize + dx) as usize
    }
}

/// Half of each pixel's own share of a link's cost.
fn node_costs(pixels: &[Pixel], training: &Training, weights: &Weights, scale: f64) -> Vec<f32> {
    let table = |t: &[f32; 256], w: f64| -> [f32; 256] { t.map(|c| c * (0.5 * w * scale) as f32) };
    let gradient = table(&training.gradient, weights.gradient);
    let value = table(&training.value, weights.value);
    let bright = table(&training.bright, weights.bright);
    let dark = table(&training.dark, weights.dark);
    let length = (0.5 * weights.length * scale) as f32;
    // The Laplacian zero-crossing cost of MB95.
    let crossing = [length + (0.5 * weights.crossing * scale) as f32, length];
    let at = |v: u8| usize::from(v);
    pixels
        .iter()
        .map(|p| {
            crossing[usize::from(p.crossing)]
                + gradient[at(p.gradient)]
                + value[at(p.value)]
                + bright[at(p.bright)]
                + dark[at(p.dark)]
        })
        .collect()
}

/// The gradient direction cost of MB95 as tables: the angle between edge and link, folded to a quarter turn, with the side it folds to.
struct Turns {
    length: [f64; 4],
    folded: [[f32; 256]; 4],
    /// Cost where the two gradients point to opposite sides of the link (the mean of both directions of eq. 4).
    opposed: f32,
}

impl Turns {
    fn new(spacing: [f64; 2], weight: f32) -> Self {
        let vector = |d: usize| [STEPS[d][0] as f64 * spacing[0], STEPS[d][1] as f64 * spacing[1]];
        let length = core::array::from_fn(|d| vector(d)[0].hypot(vector(d)[1]));
        let folded = core::array::from_fn(|d| {
            let link = turn_of(vector(d)[0] as f32, vector(d)[1] as f32);
            core::array::from_fn(|tangent| {
                let off = (tangent as u8).wrapping_sub(link);
                let angle = off.min(0u8.wrapping_sub(off));
                // 2 / (3 pi) times the angle; a quarter turn (64) costs one third. Sign: which side it folds to.
                let cost = |quarter: u8| weight * f32::from(quarter) / 192.0;
                if angle <= 64 { cost(angle) } else { -cost(128 - angle) - f32::MIN_POSITIVE }
            })
        });
        Self { length, folded, opposed: weight * (2.0 / 3.0) }
    }

    fn cost(&self, direction: usize, p: u8, q: u8) -> f32 {
        let (a, b) = (self.folded[direction][usize::from(p)], self.folded[direction][usize::from(q)]);
        if (a < 0.0) == (b < 0.0) { a.abs() + b.abs() } else { self.opposed }
    }
}
