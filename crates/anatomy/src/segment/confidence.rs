//! How far each structure can be trusted, and where it is doubtful.
//!
//! The number is an expected Dice coefficient against a careful hand. A border that lies `e` mm off on average changes
//! `A e` mm3 of a structure with surface `A`, hence its Dice by about `A e / 2V`. Where the scan shows an edge, `e` is a
//! fraction of a voxel; where it shows none (a septum thinner than a voxel, filled plexus, an opening into a lesion) the
//! border is a guess. The two errors below are those of the built-in phantoms and of three scans with references; nothing else is fitted.

use super::lattice::Lattice;
use super::noise::Noise;
use super::ventricles::Ventricles;
use crate::image::{Mask, Raster, dilate, label};
use monro_geometry::{Patient, Point, Structure};

/// Mean error of a border with and without an edge in the scan, mm.
const CLEAR_MM: f64 = 0.4;
const GUESSED_MM: f64 = 1.4;
/// An edge has at least this part of the difference between brain and fluid per mm; half of a step that is as blurred as
/// the smoothed scan.
const LEAST_EDGE: f32 = 0.15;
/// And it is steeper than noise makes a border by itself, by this factor.
const OVER_NOISE: f32 = 1.6;
/// Doubtful spots that are told, and the least of their size, mm2.
const MOST_SPOTS: usize = 4;
const LEAST_SPOT: usize = 40;

/// A part of a border that the scan does not show.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubt {
    /// The structure that it bounds.
    pub structure: Structure,
    /// Its middle, LPS mm.
    pub at: Point<Patient>,
    /// Its area, mm2.
    pub mm2: f64,
}

/// Borders of the ventricles.
#[derive(Debug)]
pub(super) struct Borders {
    /// Expected Dice of left, right and third ventricle.
    pub(super) expected: [f64; 3],
    /// The largest doubtful spots.
    pub(super) doubts: Vec<Doubt>,
}

/// Judges the ventricles by the smoothed scan `hu` on their own lattice; `brain` is its mode, HU.
pub(super) fn borders(hu: &Raster<f32>, v: &Ventricles, brain: f32, noise: Noise) -> Borders {
    let contrast = brain - v.fluid;
    let least_edge = (LEAST_EDGE * contrast).max(OVER_NOISE * noise.slope() as f32);
    let clear_mm = clear_mm(noise, f64::from(contrast));
    let mut expected = [0.0; 3];
    let mut doubts = Vec::new();
    for (class, structure) in Structure::ALL[5..].iter().enumerate() {
        let inside = v.classes.map(|c| usize::from(c) == class + 1);
        let volume = inside.count() as f64;
        let mut guessed = Mask::filled(inside.dims, false);
        let mut wrong = 0.0;
        for n in (0..inside.data.len()).filter(|&n| inside.data[n]) {
            if inside.neighbours(n).all(|m| inside.data[m]) {
                continue;
            }
            let other = inside.neighbours(n).any(|m| v.classes.data[m] > 0 && !inside.data[m]);
            // What fills a ventricle is no darker than brain.
            let clear = !other && hu.data[n] < brain && slope(hu, n) > least_edge;
            guessed.data[n] = !clear;
            wrong += if clear { clear_mm } else { GUESSED_MM };
        }
        expected[class] = if volume > 0.0 { (1.0 - wrong / (2.0 * volume)).clamp(0.0, 1.0) } else { 0.0 };
        doubts.extend(spots(&guessed, &v.lattice, *structure));
    }
    doubts.sort_by(|a, b| b.mm2.total_cmp(&a.mm2));
    doubts.truncate(MOST_SPOTS);
    Borders { expected, doubts }
}

/// Mean error of a border with an edge: a wider smoothing moves it more, and noise moves the crossing by itself over the
/// steepness of an edge that is as blurred as the smoothed scan; its mean size is 0.8 of its deviation.
fn clear_mm(noise: Noise, contrast: f64) -> f64 {
    let blur = noise.sigma * core::f64::consts::TAU.sqrt();
    (CLEAR_MM * noise.sigma).max(0.8 * noise.smooth * blur / contrast)
}

/// Steepness of the scan at a voxel, HU per mm (voxels of 1 mm).
fn slope(hu: &Raster<f32>, n: usize) -> f32 {
    let v = hu.voxel(n);
    let steps = [1, hu.dims[0], hu.dims[0] * hu.dims[1]];
    let along = |a: usize| {
        let (low, high) = (usize::from(v[a] > 0), usize::from(v[a] + 1 < hu.dims[a]));
        (hu.data[n + high * steps[a]] - hu.data[n - low * steps[a]]) / (low + high).max(1) as f32
    };
    [0, 1, 2].map(along).iter().map(|g| g * g).sum::<f32>().sqrt()
}

/// Connected parts of a border, by the voxel nearest to their middle.
fn spots(guessed: &Mask, lattice: &Lattice, structure: Structure) -> Vec<Doubt> {
    let parts = label(&dilate(guessed, 1.0));
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); parts.sizes.len()];
    for n in (0..guessed.data.len()).filter(|&n| guessed.data[n]) {
        members[parts.labels.data[n] as usize].push(n);
    }
    let middle = |m: Vec<usize>| {
        let place = |n: usize| lattice.point(guessed.voxel(n).map(|c| c as f64));
        let mut sum = [0.0; 3];
        for p in m.iter().map(|n| place(*n).to_array()) {
            (0..3).for_each(|a| sum[a] += p[a] / m.len() as f64);
        }
        let centre = Point::from_array(sum);
        let nearest = m.iter().map(|n| place(*n)).min_by(|a, b| a.distance(centre).total_cmp(&b.distance(centre)));
        Doubt { structure, at: nearest.unwrap_or(centre), mm2: m.len() as f64 }
    };
    members.into_iter().filter(|m| m.len() >= LEAST_SPOT).map(middle).collect()
}
