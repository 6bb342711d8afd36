//! The skin: its midline profile, and ways along it.

use super::LandmarkError;
use super::surroundings::Surroundings;
use monro_geometry::{Patient, Point, Structure, Vector, Volume};

/// The profile's angles (degrees above the forward direction of the model, seen from the foramina) and their step.
const FIRST: f64 = -60.0;
const LAST: f64 = 120.0;
const STEP: f64 = 0.5;
/// The nasion lies 19 to 33 degrees below forward in the heads at hand and nowhere outside this window.
const NASION: [f64; 3] = [-45.0, -26.0, -7.0];
/// Degrees over which forehead and nose stand up beside the nasion.
const BESIDE: f64 = 25.0;
/// A dip is sure from here on, mm, and in large voxels from this part of their size on: less is noise of the scan's steps, or
/// the rim of a dip at which the scan ends. Heads with a nose dip by 5 to 10 mm.
const SURE_DIP: f64 = 1.0;
const SURE_PART: f64 = 0.4;
/// A dip from here on is taken, but said to be uncertain; in proportion likewise, mm.
const FAINT_DIP: f64 = 0.15;
/// So far from the usual place, degrees, a dip counts half a millimetre less, and with the square of the distance.
const UNUSUAL: f64 = 12.0;
/// Skin must be seen above the nasion for so many degrees: 15 mm.
const GOES_ON: f64 = 10.0;
/// Longest ray, mm, and the step along it.
const FAR: f64 = 190.0;
const FINE: f64 = 0.25;
/// Air beyond the ends of the scan, and half way from it to skin, HU.
const AIR_HU: f64 = -1000.0;
const SKIN_HU: f64 = -480.0;
/// Rays across start this far below the skin: about the vault's radius.
const VAULT: f64 = 75.0;

/// The labelled head as seen from outside.
pub(crate) struct Skin<'a> {
    ct: &'a Volume<i16>,
    labels: &'a Volume<u8>,
}

impl<'a> Skin<'a> {
    /// The skin of labels that have a scalp.
    pub(crate) fn new(ct: &'a Volume<i16>, labels: &'a Volume<u8>) -> Result<Self, LandmarkError> {
        // A few stray voxels in cavities of the skull base are no scalp: a scalp has hundreds of mL.
        let scalp = labels.data().iter().filter(|&&l| l == Structure::Scalp.label()).count() as f64;
        if scalp * labels.grid().voxel_volume() < 50_000.0 {
            return Err(LandmarkError::NoSkin);
        }
        Ok(Self { ct, labels })
    }

    /// Longest side of a voxel, mm.
    pub(super) fn coarsest_mm(&self) -> f64 {
        self.ct.grid().spacing().into_iter().fold(0.0, f64::max)
    }

    /// What the scan shows at a point, HU; `None` beyond it.
    pub(super) fn hu(&self, at: Point<Patient>) -> Option<f64> {
        self.ct.trilinear(at)
    }

    /// Length of the scan's voxels in a direction, mm.
    pub(super) fn voxel_mm(&self, direction: Vector<Patient>) -> f64 {
        1.0 / self.ct.grid().voxel_from_patient().vector(direction).norm()
    }

    /// Distance along a ray at which the head is left for good; `None` where the scan ends first.
    pub(super) fn leave(&self, from: Point<Patient>, direction: Vector<Patient>) -> Option<f64> {
        let steps = (FAR / FINE) as usize;
        let at = |n: usize| from + direction * (n as f64 * FINE);
        let last = (0..steps).rev().find(|&n| self.labels.nearest(at(n)).is_some_and(|l| l != 0))?;
        // Just beyond the skin there must be labelled air, or the scan is cut here.
        let beyond = at(last + (1.5 / FINE) as usize);
        self.ct.grid().containing(beyond)?;
        Some(self.between_voxels(from, direction, (last as f64 + 0.5) * FINE))
    }

    /// The place along a ray nearest to a border of the labels where the scan itself passes from skin to air. Labels end in
    /// whole voxels, whose steps would be dips as deep as they are large. The border where the scan shows no such place
    /// within two voxels, as for labels drawn otherwise.
    fn between_voxels(&self, from: Point<Patient>, direction: Vector<Patient>, border: f64) -> f64 {
        let reach = (2.0 * self.voxel_mm(direction)).max(1.0);
        let count = (2.0 * reach / FINE).ceil() as usize;
        let along = |n: usize| border - reach + n as f64 * FINE;
        let values: Vec<f64> =
            (0..=count).map(|n| self.ct.trilinear(from + direction * along(n)).unwrap_or(AIR_HU)).collect();
        let leaves = (0..count).filter(|&n| values[n] >= SKIN_HU && values[n + 1] < SKIN_HU);
        let exact = |n: usize| along(n) + FINE * (values[n] - SKIN_HU) / (values[n] - values[n + 1]);
        leaves.map(exact).min_by(|a, b| (a - border).abs().total_cmp(&(b - border).abs())).unwrap_or(border)
    }
}

/// The midline skin in polar coordinates around the foramina.
pub(crate) struct Profile {
    origin: Point<Patient>,
    forward: Vector<Patient>,
    up: Vector<Patient>,
    /// How much larger than a millimetre the voxels are in their longest direction; 1 for smaller ones.
    coarse: f64,
    /// Radius at each angle, smoothed; `None` where the scan ends.
    radius: Vec<Option<f64>>,
}

impl Profile {
    pub(crate) fn new(skin: &Skin<'_>, surroundings: &Surroundings<'_>) -> Self {
        let origin = surroundings.origin();
        let forward = surroundings.pose.direction([0.0, -1.0, 0.0]);
        let up = surroundings.pose.direction([0.0, 0.0, 1.0]);
        let coarse = skin.coarsest_mm().max(1.0);
        let mut out = Self { origin, forward, up, coarse, radius: Vec::new() };
        let count = ((LAST - FIRST) / STEP) as usize + 1;
        let raw: Vec<Option<f64>> = (0..count).map(|n| skin.leave(origin, out.direction(n as f64))).collect();
        out.radius = smoothed(&raw, 3);
        out
    }

    /// Degrees above forward of a (continuous) sample.
    pub(super) fn angle(at: f64) -> f64 {
        FIRST + at * STEP
    }

    fn direction(&self, at: f64) -> Vector<Patient> {
        self.ray(Self::angle(at)).1
    }

    /// Where the rays of the profile begin, and the direction of the one so many degrees above forward.
    pub(super) fn ray(&self, degrees: f64) -> (Point<Patient>, Vector<Patient>) {
        let (s, c) = degrees.to_radians().sin_cos();
        (self.origin, self.forward * c + self.up * s)
    }

    /// Position of a (continuous) sample of the profile.
    pub(crate) fn point(&self, at: f64) -> Point<Patient> {
        let n = (at as usize).min(self.radius.len() - 1);
        let here = self.radius[n].unwrap_or(0.0);
        let next = self.radius.get(n + 1).copied().flatten().unwrap_or(here);
        self.origin + self.direction(at) * (here + (next - here) * (at - n as f64))
    }

    /// Sample of the nasion: the deepest dip of the profile below the chord from forehead to nose; its usual place where there
    /// is skin but no dip. A finding where it is not sure.
    pub(crate) fn nasion(&self, findings: &mut Vec<String>) -> Result<f64, LandmarkError> {
        let index = |angle: f64| ((angle - FIRST) / STEP) as usize;
        let (least, faint) = (SURE_DIP.max(SURE_PART * self.coarse), FAINT_DIP * self.coarse);
        // At the rim of what the scan shows there are dips that are none, and no way up from them.
        let window = || (index(NASION[0])..=index(NASION[2])).filter(|&n| self.goes_on(n));
        let dips = window().map(|n| (n, self.dip(n))).filter(|(_, dip)| *dip >= faint);
        let best = dips.map(|(n, dip)| (worth(dip, n), n, dip)).max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((worth, at, _)) = best
            && worth >= least
        {
            return Ok(at as f64);
        }
        let depth_mm = best.map_or(0.0, |(_, _, dip)| dip);
        let usual = window().min_by_key(|n| n.abs_diff(index(NASION[1])));
        let Some((at, place)) = best.map(|(_, at, _)| (at, "that dip")).or(usual.map(|at| (at, "its usual place")))
        else {
            return Err(LandmarkError::NoNasion { depth_mm, needed_mm: least });
        };
        findings.push(format!(
            "nasion uncertain (the midline skin dips by only {depth_mm:.1} mm where it should lie): {place} was taken, so entry \
             points may be off by 30 mm along the skin; look at the path, or give one with --plan FILE.mrk.json"
        ));
        Ok(at as f64)
    }

    /// Whether there is skin at sample `n` and for a while above it.
    fn goes_on(&self, n: usize) -> bool {
        (n..=n + (GOES_ON / STEP) as usize).all(|m| self.radius.get(m).is_some_and(Option::is_some))
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

/// What a dip of so many mm at a sample is worth: less, the further it is from where the pose of the head lets it be expected.
fn worth(dip: f64, sample: usize) -> f64 {
    dip - 0.5 * ((Profile::angle(sample as f64) - NASION[1]) / UNUSUAL).powi(2)
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

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;

    /// A ball of tissue of 80 mm radius in voxels of `step` mm, whose values show the part of each that is tissue; its labels.
    fn ball(step: f64) -> (Volume<i16>, Volume<u8>) {
        let count = (200.0 / step) as usize;
        let grid = Grid::axis_aligned([count; 3], [step; 3], [-100.0 + 0.3 * step; 3]).expect("a grid");
        let part = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            let r = grid.centre(i, j, k).to_array().iter().map(|c| c * c).sum::<f64>().sqrt();
            ((80.0 - r) / step + 0.5).clamp(0.0, 1.0)
        };
        let ct = (0..grid.len()).map(|n| (-1000.0 + 1040.0 * part(n)) as i16).collect();
        let labels = (0..grid.len()).map(|n| u8::from(part(n) > 0.5)).collect();
        (Volume::new(grid, ct).expect("values"), Volume::new(grid, labels).expect("values"))
    }

    #[test]
    fn steps_of_coarse_voxels_were_dips_and_the_deepest_the_nasion() {
        for step in [0.9, 3.0] {
            let (ct, labels) = ball(step);
            let skin = Skin::new(&ct, &labels).expect("a skin");
            for degrees in -60..60 {
                let (s, c) = f64::from(degrees).to_radians().sin_cos();
                let found = skin.leave(Point::new(0.0, 0.0, 0.0), Vector::new(0.1, -c, s)).expect("left") * 1.005;
                assert!((found - 80.0).abs() < 0.15 * step + 0.1, "{step} {degrees}: {found}");
            }
        }
    }

    #[test]
    fn labels_drawn_otherwise_than_the_scan_keep_their_own_border() {
        let (ct, labels) = ball(1.0);
        let scalp = labels.map(|_| Structure::Scalp.label());
        let skin = Skin { ct: &ct.map(|_| 40), labels: &scalp };
        assert!(skin.leave(Point::new(0.0, 0.0, 0.0), Vector::new(0.0, -1.0, 0.0)).is_none());
        let air = ct.map(|_| -1000);
        let skin = Skin { ct: &air, labels: &labels };
        let found = skin.leave(Point::new(0.0, 0.0, 0.0), Vector::new(0.0, -1.0, 0.0)).expect("left");
        assert!((found - 80.0).abs() < 1.0, "{found}");
    }

    /// A round forehead and face of 80 mm radius with a dip of this depth (mm) at an angle.
    fn profile(depth: f64, angle: f64, coarse: f64) -> Profile {
        let count = ((LAST - FIRST) / STEP) as usize + 1;
        // A chord from 20 degrees above to 20 below, less the dip.
        let radius = |n: usize| {
            let off = (Profile::angle(n as f64) - angle).abs();
            let flat = if off < 20.0 { 80.0 * 20f64.to_radians().cos() / off.to_radians().cos() } else { 80.0 };
            Some(flat - depth * (1.0 - off / 6.0).max(0.0))
        };
        let (forward, up) = (Vector::new(0.0, -1.0, 0.0), Vector::new(0.0, 0.0, 1.0));
        let origin = Point::new(0.0, 0.0, 0.0);
        Profile { origin, forward, up, coarse, radius: (0..count).map(radius).collect() }
    }

    #[test]
    fn the_rim_at_which_a_scan_cuts_the_nose_was_the_nasion_and_led_nowhere() {
        let mut cut = profile(0.0, -26.0, 1.0);
        // The nose is cut between -30 and -20 degrees, and what is left of it below stands back at the rim.
        let gone = |n: usize| (-30.0..-20.0).contains(&Profile::angle(n as f64));
        let rim = |n: usize| (-31.0..-30.0).contains(&Profile::angle(n as f64));
        (0..cut.radius.len()).filter(|&n| rim(n)).for_each(|n| cut.radius[n] = cut.radius[n].map(|r| r - 6.0));
        (0..cut.radius.len()).filter(|&n| gone(n)).for_each(|n| cut.radius[n] = None);
        let mut findings = Vec::new();
        let at = cut.nasion(&mut findings).expect("skin");
        assert!((-20.0..-7.0).contains(&Profile::angle(at)), "{}", Profile::angle(at));
        assert!(findings.iter().any(|f| f.contains("nasion uncertain")), "{findings:?}");
        assert!(cut.along(at, 60.0).is_ok());
    }

    #[test]
    fn a_dip_within_the_steps_of_coarse_voxels_or_in_an_odd_place_was_taken_without_a_word() {
        let told = |depth, angle, coarse| {
            let mut findings = Vec::new();
            let at = profile(depth, angle, coarse).nasion(&mut findings).expect("skin");
            assert!((Profile::angle(at) - angle).abs() < 3.0, "{}", Profile::angle(at));
            findings.iter().any(|f| f.contains("nasion uncertain"))
        };
        assert!(!told(6.0, -26.0, 3.0) && !told(6.0, -12.0, 5.0));
        assert!(!told(1.1, -26.0, 1.0) && told(1.1, -26.0, 3.0));
        assert!(told(1.1, -10.0, 1.0));
    }
}
