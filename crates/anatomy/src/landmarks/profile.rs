//! The skin: its midline profile, and ways along it.

use super::LandmarkError;
use super::surroundings::Surroundings;
use monro_geometry::{Grid, Patient, Point, Structure, Vector, Volume};

/// The profile's angles (degrees above the forward direction of the model, seen from the foramina) and their step.
const FIRST: f64 = -60.0;
const LAST: f64 = 120.0;
const STEP: f64 = 0.5;
/// The nasion lies 19 to 33 degrees below forward in the heads at hand and nowhere outside this window.
const NASION: [f64; 3] = [-45.0, -26.0, -7.0];
/// Degrees over which forehead and nose stand up beside the nasion.
const BESIDE: f64 = 25.0;
/// Least dip, mm: less is noise of the scan's steps.
const LEAST_DIP: f64 = 0.4;
/// A dip from here on is taken, but said to be uncertain, mm.
const FAINT_DIP: f64 = 0.15;
/// Longest ray, mm, and the step along it.
const FAR: f64 = 190.0;
const FINE: f64 = 0.25;
/// Rays across start this far below the skin: about the vault's radius.
const VAULT: f64 = 75.0;

/// The labelled head as seen from outside.
pub(crate) struct Skin<'a> {
    grid: &'a Grid,
    labels: &'a Volume<u8>,
}

impl<'a> Skin<'a> {
    /// The skin of labels that have a scalp.
    pub(crate) fn new(grid: &'a Grid, labels: &'a Volume<u8>) -> Result<Self, LandmarkError> {
        // A few stray voxels in cavities of the skull base are no scalp: a scalp has hundreds of mL.
        let scalp = labels.data().iter().filter(|&&l| l == Structure::Scalp.label()).count() as f64;
        if scalp * labels.grid().voxel_volume() < 50_000.0 {
            return Err(LandmarkError::NoSkin);
        }
        Ok(Self { grid, labels })
    }

    /// Distance along a ray at which the head is left for good; `None` where the scan ends first.
    fn leave(&self, from: Point<Patient>, direction: Vector<Patient>) -> Option<f64> {
        let steps = (FAR / FINE) as usize;
        let at = |n: usize| from + direction * (n as f64 * FINE);
        let last = (0..steps).rev().find(|&n| self.labels.nearest(at(n)).is_some_and(|l| l != 0))?;
        // Just beyond the skin there must be labelled air, or the scan is cut here.
        let beyond = at(last + (1.5 / FINE) as usize);
        self.grid.containing(beyond)?;
        Some((last as f64 + 0.5) * FINE)
    }
}

/// The midline skin in polar coordinates around the foramina.
pub(crate) struct Profile {
    origin: Point<Patient>,
    forward: Vector<Patient>,
    up: Vector<Patient>,
    /// Radius at each angle, smoothed; `None` where the scan ends.
    radius: Vec<Option<f64>>,
}

impl Profile {
    pub(crate) fn new(skin: &Skin<'_>, surroundings: &Surroundings<'_>) -> Self {
        let plane = surroundings.midsagittal;
        let origin = plane.project(surroundings.pose.place([0.0; 3]));
        let forward = surroundings.pose.direction([0.0, -1.0, 0.0]);
        let up = surroundings.pose.direction([0.0, 0.0, 1.0]);
        let mut out = Self { origin, forward, up, radius: Vec::new() };
        let count = ((LAST - FIRST) / STEP) as usize + 1;
        let raw: Vec<Option<f64>> = (0..count).map(|n| skin.leave(origin, out.direction(n as f64))).collect();
        out.radius = smoothed(&raw, 3);
        out
    }

    fn angle(at: f64) -> f64 {
        FIRST + at * STEP
    }

    fn direction(&self, at: f64) -> Vector<Patient> {
        let (s, c) = Self::angle(at).to_radians().sin_cos();
        self.forward * c + self.up * s
    }

    /// Position of a (continuous) sample of the profile.
    pub(crate) fn point(&self, at: f64) -> Point<Patient> {
        let n = (at as usize).min(self.radius.len() - 1);
        let here = self.radius[n].unwrap_or(0.0);
        let next = self.radius.get(n + 1).copied().flatten().unwrap_or(here);
        self.origin + self.direction(at) * (here + (next - here) * (at - n as f64))
    }

    /// Sample of the nasion: the deepest dip of the profile below the chord from forehead to nose; its usual place, with a
    /// finding, where there is skin but no dip.
    pub(crate) fn nasion(&self, findings: &mut Vec<String>) -> Result<f64, LandmarkError> {
        let index = |angle: f64| ((angle - FIRST) / STEP) as usize;
        let mut best = (f64::NEG_INFINITY, 0usize, 0.0);
        for n in index(NASION[0])..=index(NASION[2]) {
            let dip = self.dip(n);
            // Half a millimetre per 12 degrees squared from the usual place decides between dips of like depth.
            let value = dip - 0.5 * ((Self::angle(n as f64) - NASION[1]) / 12.0).powi(2);
            if dip >= FAINT_DIP && value > best.0 {
                best = (value, n, dip);
            }
        }
        let (_, at, depth_mm) = best;
        if depth_mm >= LEAST_DIP {
            return Ok(at as f64);
        }
        let usual = index(NASION[1]);
        let (at, place) = if depth_mm > 0.0 { (at, "that dip") } else { (usual, "its usual place") };
        if self.radius[at].is_none() {
            return Err(LandmarkError::NoNasion { depth_mm, needed_mm: LEAST_DIP });
        }
        findings.push(format!(
            "nasion uncertain (the midline skin dips by only {depth_mm:.1} mm where it should lie): {place} was taken, so entry \
             points may be off by 20 mm along the skin; look at the path, or give one with --plan FILE.mrk.json"
        ));
        Ok(at as f64)
    }

    /// How far sample `n` lies below the highest chord between its two sides, mm; 0 where it does not dip.
    fn dip(&self, n: usize) -> f64 {
        let flat = |m: usize| -> Option<[f64; 2]> {
            let (s, c) = Self::angle(m as f64).to_radians().sin_cos();
            self.radius.get(m).copied().flatten().map(|r| [r * c, r * s])
        };
        let Some(p) = flat(n) else { return 0.0 };
        let reach = (BESIDE / STEP) as usize;
        let above: Vec<[f64; 2]> = (n + 2..n + reach).filter_map(flat).collect();
        let below: Vec<[f64; 2]> = (n.saturating_sub(reach)..n.saturating_sub(1)).filter_map(flat).collect();
        let mut best = 0f64;
        for a in &above {
            for b in &below {
                let (d, v) = ([a[0] - b[0], a[1] - b[1]], [p[0] - b[0], p[1] - b[1]]);
                // Positive when the point lies behind the chord from nose (b) to forehead (a).
                best = best.max((v[1] * d[0] - v[0] * d[1]) / d[0].hypot(d[1]));
            }
        }
        best
    }

    /// The sample `way` mm along the profile upwards from sample `from`, and the outward direction there.
    pub(crate) fn along(&self, from: f64, way: f64) -> Result<(f64, Vector<Patient>), LandmarkError> {
        let mut left = way;
        let mut n = from as usize;
        while n + 1 < self.radius.len() {
            if self.radius[n + 1].is_none() {
                break;
            }
            let step = self.point(n as f64).distance(self.point((n + 1) as f64));
            if step >= left {
                let at = n as f64 + left / step;
                return Ok((at, self.outward(at)));
            }
            left -= step;
            n += 1;
        }
        Err(LandmarkError::SkinCut { from: "the nasion", reached_mm: way - left, needed_mm: way })
    }

    /// Outward normal of the profile: perpendicular to its chord over 10 degrees either side.
    fn outward(&self, at: f64) -> Vector<Patient> {
        let reach = (10.0 / STEP) as usize;
        let n = at as usize;
        let end = (n + 1..(n + reach).min(self.radius.len())).rev().find(|&m| self.radius[m].is_some()).unwrap_or(n);
        let chord = self.point(end as f64) - self.point(n.saturating_sub(reach) as f64);
        let radial = self.direction(at);
        chord.normalized().and_then(|t| (radial - t * radial.dot(t)).normalized()).unwrap_or(radial)
    }
}

/// Moving mean over `half` samples either side, over those that exist; a missing sample stays missing.
fn smoothed(raw: &[Option<f64>], half: usize) -> Vec<Option<f64>> {
    (0..raw.len())
        .map(|n| {
            raw[n]?;
            let near: Vec<f64> =
                raw[n.saturating_sub(half)..(n + half + 1).min(raw.len())].iter().copied().flatten().collect();
            Some(near.iter().sum::<f64>() / near.len() as f64)
        })
        .collect()
}

/// The point `way` mm along the skin from `start` in the direction `side`, in the plane of `side` and `outward`.
pub(crate) fn across(
    skin: &Skin<'_>,
    start: Point<Patient>,
    outward: Vector<Patient>,
    side: Vector<Patient>,
    way: f64,
) -> Result<Point<Patient>, LandmarkError> {
    let centre = start - outward * VAULT;
    let direction = |n: usize| {
        let (s, c) = (n as f64 * 0.5).to_radians().sin_cos();
        outward * c + side * s
    };
    let raw: Vec<Option<f64>> = (0..120).map(|n| skin.leave(centre, direction(n))).collect();
    let radius = smoothed(&raw, 4);
    let mut left = way;
    for n in 0..radius.len() - 1 {
        let (Some(here), Some(next)) = (radius[n], radius[n + 1]) else { break };
        let (p, q) = (centre + direction(n) * here, centre + direction(n + 1) * next);
        let step = p.distance(q);
        if step >= left {
            return Ok(p.lerp(q, left / step));
        }
        left -= step;
    }
    Err(LandmarkError::SkinCut { from: "the midline", reached_mm: way - left, needed_mm: way })
}
