//! The ventricles: fluid reached from the posed model's seeds before it is reached from cisterns and sulci.

use super::air::Air;
use super::blood::{Clot, clot};
use super::boundary;
use super::confidence::{Borders, Doubt, borders};
use super::error::SegmentError;
use super::fit::{Picture, fitted};
use super::lattice::Lattice;
use super::model::Pose;
use super::noise::Noise;
use super::samples::Samples;
use super::tissue::quantile;
use super::working::Binned;
use crate::image::{Mask, Raster, close, dilate, distance_to, distance_to_false, label, open, watershed};
use monro_geometry::{Patient, Point};

/// Classes of the map: as below, 0 none.
pub(crate) const LEFT: u8 = 1;
pub(crate) const RIGHT: u8 = 2;
pub(crate) const THIRD: u8 = 3;
/// Fluid outside the ventricles: a rival in the flood only.
const ELSEWHERE: u8 = 4;

/// Room around the model's course, mm.
const ROOM: f64 = 40.0;
/// Fluid must be at least this much darker than brain, HU.
const LEAST_CONTRAST: f32 = 8.0;
/// Calcified choroid plexus is at least this much brighter than brain, HU (grey matter is 5 brighter than white).
const CALCIFIED: f32 = 13.0;
/// Around a calcified core the choroid plexus is still this much brighter than brain, HU; it fills an atrium up to this
/// gap, mm.
const CHOROID: f32 = 8.0;
const CHOROID_GAP: f32 = 4.0;
/// Room around the ventricles in which their surface is fitted, voxels.
const SURFACE_ROOM: usize = 9;
/// The layer that tells the level of the tissue beside a ventricle, mm from it: beyond partial volume, and near.
const BESIDE: core::ops::Range<f32> = 1.5..5.0;
/// Ventricles are wide where a ball of this radius has room, mm; bright parts of fewer voxels (1 mm) do not count.
const WIDE: f32 = 8.0;
const SPECK: usize = 30;
/// A lateral ventricle has at least this, mL.
const LEAST_ML: f64 = 0.4;

/// What the search needs to know, on the working raster (1 mm voxels).
#[derive(Debug)]
pub(crate) struct Scene<'a> {
    pub(crate) lattice: Lattice,
    /// The scan, HU, and its own voxels.
    pub(crate) raw: &'a Raster<f32>,
    pub(crate) binned: &'a Binned,
    /// Smoothed HU.
    pub(crate) smooth: &'a Raster<f32>,
    pub(crate) cavity: &'a Mask,
    /// Depth below the inner skull, mm.
    pub(crate) depth: &'a Raster<f32>,
    pub(crate) pose: Pose,
    /// Mode of the brain, HU.
    pub(crate) brain: f32,
    pub(crate) noise: Noise,
    /// Whether the ventricles hold blood.
    pub(crate) blood: bool,
}

/// The ventricles on a crop of the working raster.
#[derive(Debug)]
pub(crate) struct Ventricles {
    pub(crate) lattice: Lattice,
    /// [`LEFT`], [`RIGHT`], [`THIRD`] or 0.
    pub(crate) classes: Raster<u8>,
    /// Signed distance to the ventricles' surface, mm, positive inside.
    pub(crate) field: Raster<f32>,
    /// Mode of the fluid, HU.
    pub(crate) fluid: f32,
    /// Edge between fluid and brain, HU.
    pub(crate) edge: f32,
    /// Air in the ventricles, mL.
    pub(crate) air_ml: f64,
    /// Blood in the ventricles, voxels of `lattice`.
    pub(crate) clot: Option<Clot>,
    /// Expected Dice of left, right and third.
    pub(crate) expected: [f64; 3],
    /// Where the surface is a guess.
    pub(crate) doubts: Vec<Doubt>,
}

/// The crop with all that the steps share.
struct Crop<'a> {
    scene: &'a Scene<'a>,
    lattice: Lattice,
    /// The scan and the smoothed scan, HU.
    raw: Raster<f32>,
    hu: Raster<f32>,
    air: Air,
    cavity: Mask,
    depth: Raster<f32>,
    /// Distance to the model's course on each side, mm.
    course: [Raster<f32>; 2],
    /// The same with the temporal horns.
    horns: [Raster<f32>; 2],
}

/// Finds the ventricles.
///
/// # Errors
/// [`SegmentError::NoContrast`], [`SegmentError::NoVentricle`].
pub(crate) fn ventricles(scene: &Scene<'_>) -> Result<Ventricles, SegmentError> {
    let mut crop = Crop::new(scene)?;
    let fluid = crop.fluid()?;
    crop.air.fill(&mut crop.hu, fluid);
    crop.air.fill(&mut crop.raw, fluid);
    let edge = (fluid + scene.brain) / 2.0;
    let clot = crop.clot();
    let mut calcified = crop.calcified();
    if let Some(clot) = &clot {
        calcified = calcified.or(&clot.mask);
    }
    let dark = crop.hu.zip(&crop.cavity, |v, c| c && v < edge).or(&calcified.and(&crop.cavity));
    let (markers, flooded) = crop.flood(&dark, &calcified, (fluid, edge));
    let lateral = crop.lateral(&flooded, &markers);
    let third = crop.third(&flooded, &markers);
    let mut classes = Raster::filled(crop.hu.dims, 0u8);
    for n in 0..classes.data.len() {
        classes.data[n] = if lateral.data[n] > 0 { lateral.data[n] } else { u8::from(third.data[n]) * THIRD };
    }
    enough(&classes)?;
    let (classes, field) = crop.surface(&classes, &flooded, (fluid, edge));
    let air_ml = crop.air.ml(|n| classes.data[n] > 0);
    let mut found = Ventricles {
        lattice: crop.lattice,
        classes,
        field,
        fluid,
        edge,
        air_ml,
        clot,
        expected: [0.0; 3],
        doubts: Vec::new(),
    };
    let Borders { expected, doubts } = borders(&crop.hu, &found, scene.brain, scene.noise);
    (found.expected, found.doubts) = (expected, doubts);
    Ok(found)
}

/// Refuses when a side is missing.
fn enough(classes: &Raster<u8>) -> Result<(), SegmentError> {
    for (class, side) in [(LEFT, "left"), (RIGHT, "right")] {
        let found_ml = classes.data.iter().filter(|&&c| c == class).count() as f64 / 1000.0;
        if found_ml < LEAST_ML {
            return Err(SegmentError::NoVentricle { side, found_ml, needed_ml: LEAST_ML });
        }
    }
    Ok(())
}

impl<'a> Crop<'a> {
    fn new(scene: &'a Scene<'a>) -> Result<Self, SegmentError> {
        let courses = [1.0, -1.0].map(|side| scene.pose.course(side));
        let dims = scene.smooth.dims;
        let indices: Vec<[f64; 3]> = courses.iter().flatten().map(|p| scene.lattice.index(*p)).collect();
        let bound = |a: usize, v: f64| v.clamp(0.0, dims[a] as f64) as usize;
        let low: [usize; 3] =
            core::array::from_fn(|a| bound(a, indices.iter().map(|v| v[a]).fold(f64::INFINITY, f64::min) - ROOM));
        let high: [usize; 3] =
            core::array::from_fn(|a| bound(a, indices.iter().map(|v| v[a]).fold(f64::NEG_INFINITY, f64::max) + ROOM));
        if (0..3).any(|a| high[a] < low[a] + 20) {
            return Err(SegmentError::NoVentricle { side: "left or right", found_ml: 0.0, needed_ml: LEAST_ML });
        }
        let lattice = scene.lattice.cropped(low);
        let cavity = scene.cavity.crop(low, high);
        let mut drawings = courses.map(|c| drawn(&c, &lattice, cavity.dims));
        let course = drawings.each_ref().map(distance_to);
        for (drawing, side) in drawings.iter_mut().zip([1.0, -1.0]) {
            *drawing = drawing.or(&drawn(&scene.pose.temporal(side), &lattice, cavity.dims));
        }
        let horns = drawings.each_ref().map(distance_to);
        let depth = scene.depth.crop(low, high);
        let (raw, hu) = (scene.raw.crop(low, high), scene.smooth.crop(low, high));
        let air = Air::of(&hu, &cavity);
        Ok(Self { scene, lattice, raw, hu, air, cavity, depth, course, horns })
    }

    fn nearest_course(&self, n: usize) -> f32 {
        self.course[0].data[n].min(self.course[1].data[n])
    }

    /// Model coordinates of a voxel.
    fn model(&self, n: usize) -> [f64; 3] {
        self.scene.pose.model(self.lattice.point(self.hu.voxel(n).map(|c| c as f64)))
    }

    /// Mode of the fluid: the lower quartile of what is clearly darker than brain along the course, so that neither
    /// partial volume nor oedema beside the ventricle counts.
    fn fluid(&self) -> Result<f32, SegmentError> {
        let brain = self.scene.brain;
        let mut dark: Vec<f32> = (0..self.hu.data.len())
            .filter(|&n| !self.air.all.data[n] && self.nearest_course(n) <= 3.0)
            .filter(|&n| self.hu.data[n] < brain - LEAST_CONTRAST)
            .map(|n| self.hu.data[n])
            .collect();
        let fluid = quantile(&mut dark, 0.25);
        if dark.len() < 100 || brain - fluid < LEAST_CONTRAST {
            let csf = if dark.is_empty() { brain } else { fluid };
            return Err(SegmentError::NoContrast { brain: brain.into(), csf: csf.into() });
        }
        Ok(fluid)
    }

    /// Blood along the course and the temporal horns.
    fn clot(&self) -> Option<Clot> {
        let course = self.horns[0].zip(&self.horns[1], |l, r| l.min(r));
        let level = (self.scene.brain, self.scene.pose.scale);
        self.scene.blood.then(|| clot(&self.hu, &self.cavity, &course, level)).flatten()
    }

    /// Calcified choroid plexus with its dimmed rim: bright, deep, off the midline, near the course behind the foramina.
    fn calcified(&self) -> Mask {
        let mut bright = Mask::filled(self.hu.dims, false);
        let bound = (14.0 * self.scene.pose.scale) as f32;
        for n in 0..bright.data.len() {
            if self.hu.data[n] > self.scene.brain + CALCIFIED
                && self.depth.data[n] > 12.0
                && self.nearest_course(n) < bound
            {
                let [lateral, posterior, _] = self.model(n);
                bright.data[n] = lateral.abs() > 8.0 && posterior > 10.0;
            }
        }
        dilate(&bright, 1.5)
    }

    /// Floods the dark voxels from seeds of the two lateral ventricles, the third, and everything else.
    fn flood(&self, dark: &Mask, calcified: &Mask, (fluid, edge): (f32, f32)) -> (Raster<u8>, Raster<u8>) {
        let inner = distance_to_false(dark);
        let wide = self.wide(dark);
        let mut markers = Raster::filled(dark.dims, 0u8);
        let mut height = Raster::filled(dark.dims, 0f32);
        for n in 0..dark.data.len() {
            if dark.data[n] {
                markers.data[n] = self.marker(n, inner.data[n], wide.data[n]);
                let hu = if calcified.data[n] { fluid } else { self.hu.data[n].max(fluid) };
                // Dark and wide first: a septum or a thin floor is brighter, a foramen narrower than what it joins.
                height.data[n] = 0.5 * hu / (edge - fluid) - 0.08 * inner.data[n].min(4.0);
            }
        }
        // Where ventricles are wide their own fluid comes before that of what lies about them.
        let within = watershed(&height, &markers, &wide.and(dark));
        let first = markers.zip(&within, |m, w| if w > 0 { w } else { m });
        (markers, watershed(&height, &first, dark))
    }

    /// Where ventricles are wide: what holds a ball of [`WIDE`] and hangs together with the course, specks of noise aside. Large
    /// ventricles reach where others end, so that where fluid lies tells nothing of it there.
    fn wide(&self, dark: &Mask) -> Mask {
        let bright = label(&dark.not());
        let whole = dark.or(&bright.keep(|part| bright.sizes[part as usize] < SPECK));
        let near = self.near_course();
        let mut course = Mask::filled(dark.dims, false);
        (0..dark.data.len()).for_each(|n| course.data[n] = self.nearest_course(n) <= near);
        label(&open(&whole, WIDE)).touching(&course)
    }

    /// What is no farther from the model's course is on it, mm.
    fn near_course(&self) -> f32 {
        (2.5 * self.scene.pose.scale) as f32
    }

    /// The seed class of a dark voxel, `inner` mm from the nearest brighter one; 0 for none. Where ventricles are `wide` none is
    /// of what lies elsewhere.
    fn marker(&self, n: usize, inner: f32, wide: bool) -> u8 {
        let m = self.model(n);
        // Sulci and cisterns reach the skull; of the ventricles only the temporal horns come near it.
        let in_horn = self.horns[0].data[n].min(self.horns[1].data[n]) < (6.0 * self.scene.pose.scale) as f32;
        let shallow = if in_horn { 4.0 } else { 9.0 };
        if !wide && (self.depth.data[n] < shallow || !in_horn && is_cistern(m)) {
            return ELSEWHERE;
        }
        let near = self.near_course();
        let [lateral, posterior, superior] = m;
        if inner >= 1.0 && self.course[0].data[n] <= near && lateral > 2.5 {
            LEFT
        } else if inner >= 1.0 && self.course[1].data[n] <= near && lateral < -2.5 {
            RIGHT
        } else if lateral.abs() < 2.0 && (1.0..14.0).contains(&posterior) && (-13.0..-4.0).contains(&superior) {
            THIRD
        } else {
            0
        }
    }

    /// The lateral ventricles: parts that hold a seed, without thin runners far from the course, choroid holes filled.
    fn lateral(&self, flooded: &Raster<u8>, markers: &Raster<u8>) -> Raster<u8> {
        let mut out = Raster::filled(flooded.dims, 0u8);
        let keep = (10.0 * self.scene.pose.scale) as f32;
        for (class, course) in [(LEFT, &self.horns[0]), (RIGHT, &self.horns[1])] {
            let all = flooded.map(|c| c == class);
            let thick = open(&all, 1.5);
            let mut kept = all.and(&thick);
            for n in 0..kept.data.len() {
                kept.data[n] |= all.data[n] && course.data[n] < keep;
            }
            let seeds = markers.map(|m| m == class);
            let kept = label(&kept).touching(&seeds);
            let filled = close(&kept, 2.0).or(&self.choroid(&kept));
            for n in 0..out.data.len() {
                let free = flooded.data[n] == 0 || flooded.data[n] == class;
                if kept.data[n] || filled.data[n] && free && self.cavity.data[n] {
                    out.data[n] = class;
                }
            }
        }
        out
    }

    /// The atrium with the choroid plexus in it: fluid and bright voxels near it, closed.
    fn choroid(&self, kept: &Mask) -> Mask {
        let in_atrium = |n: usize| {
            let [lateral, posterior, _] = self.model(n);
            lateral.abs() > 10.0 && posterior > 25.0
        };
        let near = distance_to(kept);
        let mut plexus = Mask::filled(kept.dims, false);
        let mut core = plexus.clone();
        for n in 0..plexus.data.len() {
            let above = self.hu.data[n] - self.scene.brain;
            if above > CHOROID && near.data[n] < CHOROID_GAP && self.cavity.data[n] && in_atrium(n) {
                plexus.data[n] = true;
                core.data[n] = above > CALCIFIED;
            }
        }
        // Noise and grey matter reach the lower bound here and there, never the core's.
        let plexus = label(&plexus).touching(&core);
        let plexus_near = distance_to(&plexus);
        let mut closed = close(&kept.or(&dilate(&plexus, 1.0)), CHOROID_GAP);
        for n in 0..closed.data.len() {
            closed.data[n] = closed.data[n] && plexus_near.data[n] < 2.0 * CHOROID_GAP && in_atrium(n);
        }
        closed
    }

    /// The third ventricle: the seeded part within its own surroundings.
    fn third(&self, flooded: &Raster<u8>, markers: &Raster<u8>) -> Mask {
        let mut all = flooded.map(|c| c == THIRD);
        for n in 0..all.data.len() {
            if all.data[n] {
                let [lateral, posterior, superior] = self.model(n);
                all.data[n] =
                    lateral.abs() < 10.0 && (-12.0..32.0).contains(&posterior) && (-24.0..9.0).contains(&superior);
            }
        }
        label(&all).touching(&markers.map(|m| m == THIRD))
    }

    /// The classes and the signed distance to their surface after it has been fitted to the scan.
    fn surface(
        &self,
        classes: &Raster<u8>,
        flooded: &Raster<u8>,
        (fluid, edge): (f32, f32),
    ) -> (Raster<u8>, Raster<f32>) {
        let guess = self.guess(classes, flooded, (fluid, edge));
        // Fluid that belongs elsewhere, what fills a ventricle, and air would pull the surface.
        let other = flooded.zip(classes, |f, c| f > 0 && c == 0);
        let filled = classes.zip(&self.hu, |c, v| c > 0 && v > self.scene.brain + CHOROID);
        let counts = self.cavity.minus(&dilate(&other, 1.0)).minus(&dilate(&filled, 2.0)).minus(&self.air.all);
        let mut field = self.fitted(&guess, classes, &counts, (fluid, edge));
        for n in 0..field.data.len() {
            if filled.data[n] {
                field.data[n] = field.data[n].max(0.5);
            } else if other.data[n] || !self.cavity.data[n] {
                field.data[n] = field.data[n].min(-0.5);
            }
        }
        let classes = watershed(&field.map(|d| -d), classes, &field.map(|d| d > 0.0));
        for (value, class) in field.data.iter_mut().zip(&classes.data) {
            // No class reaches it: an island.
            *value = if *class > 0 { *value } else { value.min(-0.05) };
        }
        (classes, field)
    }

    /// The fit in a box about the ventricles; outside of it nothing is ventricle.
    fn fitted(
        &self,
        guess: &Raster<f32>,
        classes: &Raster<u8>,
        counts: &Mask,
        (fluid, edge): (f32, f32),
    ) -> Raster<f32> {
        let (low, high) = classes.map(|c| c > 0).bounds(SURFACE_ROOM).unwrap_or(([0; 3], classes.dims));
        let start = guess.crop(low, high);
        let Some(samples) = Samples::new(self.scene.binned, &self.lattice.cropped(low), start.dims) else {
            return guess.clone();
        };
        let tissue = self.hu.map(|v| (edge..self.scene.brain + CALCIFIED).contains(&v));
        let picture = Picture {
            hu: &self.raw.crop(low, high),
            samples: &samples,
            counts: &counts.crop(low, high),
            tissue: &tissue.crop(low, high),
            fluid,
            brain: self.scene.brain,
        };
        let fitted = fitted(&start, &picture);
        let mut field = Raster::filled(classes.dims, -1f32);
        for (n, value) in fitted.data.iter().enumerate() {
            let v = fitted.voxel(n);
            let at = field.index(v[0] + low[0], v[1] + low[1], v[2] + low[2]);
            field.data[at] = *value;
        }
        field
    }

    /// First guess of the surface, the zero of a signed field: the scan half way between the fluid and the tissue beside it where that
    /// is next to a class, a step where a class ends otherwise.
    fn guess(&self, classes: &Raster<u8>, flooded: &Raster<u8>, (fluid, edge): (f32, f32)) -> Raster<f32> {
        let near = distance_to(&classes.map(|c| c > 0));
        let hu = boundary::smoothed(&self.raw);
        let tissue = boundary::tissue(&self.raw, &self.beside(&near, edge), self.scene.brain);
        let mut field = Raster::filled(classes.dims, -0.5f32);
        for n in 0..field.data.len() {
            let half = (tissue.data[n] - fluid) / 2.0;
            let dark = ((fluid + half - hu.data[n]) / half).clamp(-0.5, 1.0);
            if classes.data[n] > 0 {
                // Filled choroid is inside although bright.
                field.data[n] = if self.hu.data[n] < edge { dark } else { 0.5 };
            } else if near.data[n] <= 1.5 && self.cavity.data[n] && flooded.data[n] == 0 {
                // Only what shares a face with a class may join it: no islands of noise.
                field.data[n] = if near.data[n] <= 1.0 { dark } else { dark.min(0.0) };
            }
        }
        field
    }

    /// Voxels of tissue in the layer beside the ventricles.
    fn beside(&self, near: &Raster<f32>, edge: f32) -> Mask {
        let tissue = edge..self.scene.brain + CALCIFIED;
        let layer = near.zip(&self.cavity, |d, c| c && BESIDE.contains(&d));
        layer.zip(&self.hu, |l, v| l && tissue.contains(&v))
    }
}

/// Where the model says that fluid is cistern, fissure or posterior fossa.
fn is_cistern([lateral, posterior, superior]: [f64; 3]) -> bool {
    let off = lateral.abs();
    let quadrigeminal = off < 8.0 && posterior > 27.0 && superior < 6.0;
    let suprasellar = off < 9.0 && posterior < 14.0 && superior < -19.0;
    let below_tentorium = off < 22.0 && posterior < 40.0 && superior < -27.0;
    let insular = off > 30.0 && posterior < 22.0 && (-5.0..12.0).contains(&superior);
    let interhemispheric = off < 4.0 && superior > 32.0 || off < 3.0 && posterior < -36.0;
    quadrigeminal || suprasellar || below_tentorium || insular || interhemispheric
}

/// The voxels through which a course runs.
fn drawn(course: &[Point<Patient>], lattice: &Lattice, dims: [usize; 3]) -> Mask {
    let mut mask = Mask::filled(dims, false);
    for p in course {
        let v = lattice.index(*p).map(f64::round);
        if (0..3).all(|a| v[a] >= 0.0 && v[a] < dims[a] as f64) {
            let n = mask.index(v[0] as usize, v[1] as usize, v[2] as usize);
            mask.data[n] = true;
        }
    }
    mask
}
