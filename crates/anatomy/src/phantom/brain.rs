//! The brain in its cavity: hemispheres with sulci and fissures, cerebellum, brain stem, cisterns and dura.

use super::shapes::{At, at, capsule, ellipse, ellipsoid, folded, join, without};

/// What differs between one head's brain and another's.
#[derive(Debug, Clone, Copy)]
pub(super) struct BrainShape {
    /// Gap between the inner table and the brain, mm.
    pub(super) csf_gap: f64,
    /// Width of the sulci, mm; 0 gives a smooth brain.
    pub(super) sulcus_width: f64,
    /// Where the folding pattern starts, mm: makes the sulci of two heads differ.
    pub(super) fold_phase: [f64; 3],
}

/// Least thickness of the tissue around the ventricles, mm.
const VENTRICLE_WALL: f64 = 2.5;

/// How deep the sulci reach below the inner table, mm.
const SULCUS_DEPTH: f64 = 15.0;

impl BrainShape {
    /// Distance to the brain with its ventricles filled in.
    pub(super) fn distance(&self, p: At, cavity: f64, ventricles: f64) -> f64 {
        let q = folded(p);
        let surface = cavity + self.csf_gap;
        let tent = tentorium(q);
        let stem = stem(q);
        // The cord's canal is not brain; the cerebrum keeps away from the tentorium, and so does the cerebellum.
        let cerebrum = surface
            .max(1.2 - tent)
            .max(-self.fissures(q))
            .max(-self.sulci(p, cavity))
            .max((13.0 - q.x).min(-24.0 - q.z));
        let cerebellum = surface.max(tent + 1.2).max(-64.0 - q.z);
        let brain = cerebrum.min(cerebellum);
        let brain = without(join(brain, stem.max(surface + 1.0), 2.0), cisterns(q), 1.5);
        // No sulcus or cistern comes nearer than this to a ventricle.
        brain.min((ventricles - VENTRICLE_WALL).max(surface))
    }

    /// CSF between the hemispheres and in the Sylvian fissures.
    fn fissures(&self, q: At) -> f64 {
        // Corpus callosum and diencephalon bridge the midline inside this outline.
        let bridge = ellipse([q.y - 10.0, q.z - 1.0], [46.0, 27.0]);
        let between = (q.x - 1.5).max(-bridge);
        let tilt = q.z + 6.0 - 0.25 * (q.x - 35.0) - 0.2 * (q.y + 5.0);
        let sylvian = (tilt.abs() - 1.0).max(34.0 - q.x).max((q.y - 2.0).abs() - 26.0);
        between.min(sylvian)
    }

    /// Folds: sheets of a warped gyroid, from the surface to a fixed depth.
    fn sulci(&self, p: At, cavity: f64) -> f64 {
        let deep = -cavity - SULCUS_DEPTH;
        if self.sulcus_width <= 0.0 || deep > 4.0 {
            return 8.0;
        }
        const PERIOD: f64 = 4.6;
        let f = self.fold_phase;
        let (x, y, z) = ((p.x + f[0]) / PERIOD, (p.y + f[1]) / PERIOD, (p.z + f[2]) / PERIOD);
        let (x, y, z) = (x + 0.7 * (0.31 * y).sin(), y + 0.7 * (0.27 * z).sin(), z + 0.7 * (0.33 * x).sin());
        let (sx, cx) = x.sin_cos();
        let (sy, cy) = y.sin_cos();
        let (sz, cz) = z.sin_cos();
        let value = sx * cy + sy * cz + sz * cx;
        let gradient = (cx * cy - sz * sx).hypot(cy * cz - sx * sy).hypot(cz * cx - sy * sz).max(0.4);
        let sheet = value.abs() / gradient * PERIOD - 0.5 * self.sulcus_width;
        sheet.max(deep)
    }
}

/// Inside this outline lies the posterior fossa; its upper face is the tentorium (folded point).
fn tentorium(q: At) -> f64 {
    ellipsoid(q, at(0.0, 50.0, -46.0), [60.0, 48.0, 34.0 - 6.0 * (q.x / 60.0).min(1.0)])
}

fn stem(q: At) -> f64 {
    let midbrain = capsule(q, (at(0.0, 14.0, -14.0), 14.0), (at(0.0, 15.0, -28.0), 13.0));
    let pons = ellipsoid(q, at(0.0, 13.0, -38.0), [15.0, 11.5, 13.0]);
    let medulla = capsule(q, (at(0.0, 18.0, -48.0), 9.0), (at(0.0, 27.0, -72.0), 7.0));
    let cord = capsule(q, (at(0.0, 27.0, -72.0), 6.5), (at(0.0, 33.0, -150.0), 5.5));
    let peduncle = capsule(q, (at(10.0, 18.0, -39.0), 7.0), (at(24.0, 40.0, -42.0), 8.0));
    join(join(join(midbrain, pons, 5.0), join(medulla, cord, 4.0), 5.0), peduncle, 4.0)
}

/// CSF spaces of the base and the fourth ventricle (folded point).
fn cisterns(q: At) -> f64 {
    let suprasellar = ellipsoid(q, at(0.0, -8.0, -25.0), [11.0, 8.0, 4.5]);
    let ambient = capsule(q, (at(15.5, 12.0, -22.0), 1.2), (at(9.0, 31.0, -17.0), 1.8));
    let quadrigeminal = ellipsoid(q, at(0.0, 35.0, -13.0), [10.0, 3.0, 6.0]);
    let fourth = ellipsoid(q, at(0.0, 30.0, -39.0), [6.5, 4.0, 9.0]);
    let magna = ellipsoid(q, at(0.0, 52.0, -66.0), [13.0, 10.0, 7.0]);
    suprasellar.min(ambient).min(quadrigeminal).min(fourth).min(magna)
}

/// Falx and tentorium, thin sheets of dura (folded point).
pub(super) fn dura(q: At, cavity: f64) -> f64 {
    let tent = tentorium(q);
    let bridge = ellipse([q.y - 10.0, q.z - 1.0], [52.0, 33.0]);
    let falx = (q.x - 0.6).max(-bridge).max(1.0 - tent).max(-20.0 - q.z);
    let sheet = (tent.abs() - 0.7).max(-stem(q) + 9.0).max(-10.0 - q.y + 22.0);
    falx.min(sheet).max(cavity)
}

/// Deep grey matter beside the caudate's head: thalamus, lentiform nucleus (folded point).
pub(super) fn deep_grey(q: At) -> f64 {
    let thalamus = ellipsoid(q, at(11.5, 12.0, -1.5), [7.5, 14.0, 8.5]);
    let lentiform = ellipsoid(q, at(24.0, -3.0, -1.0), [6.5, 16.0, 8.5]);
    thalamus.min(lentiform)
}

/// Calcifications that most adults have: pineal gland and the plexus in the atria (folded point).
pub(super) fn calcification(q: At) -> f64 {
    let pineal = ellipsoid(q, at(0.0, 29.5, -6.5), [2.2, 2.8, 2.0]);
    let plexus = ellipsoid(q, at(22.5, 45.0, 5.0), [1.6, 2.2, 1.8]);
    pineal.min(plexus)
}
