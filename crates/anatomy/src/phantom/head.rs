//! The analytic head: every structure as a signed distance, in the patient frame.

use super::brain::{BrainShape, calcification, deep_grey, dura};
use super::cranium::{self, FORAMEN_MAGNUM_Z};
use super::paint::{Model, Painter};
use super::random::Random;
use super::shapes::{At, folded};
use super::skin::{self, SkinShape};
use super::ventricles::{VentricleShape, Ventricles, caudate_head};
use super::{Head, HeadOptions};
use monro_geometry::{Affine, Matrix3, Patient, Point, Rigid, Structure, Vector};

/// The analytic truth behind a head phantom: signed distances (mm, negative inside) at any point of the patient frame.
/// They are exact in sign, and within about a tenth of the true distance within 5 mm of a surface.
#[derive(Debug, Clone)]
pub struct HeadModel {
    patient_from_head: Affine<Patient, Head>,
    head_from_patient: Affine<Head, Patient>,
    scale: f64,
    pub(super) noise_hu: f64,
    ventricles: Ventricles,
    brain: BrainShape,
    skin: SkinShape,
    head_rest: bool,
}

/// Ranges of an adult head that the seed draws from.
struct Draw {
    scales: [f64; 3],
    turns: [f64; 3],
    offset: [f64; 3],
    ventricles: VentricleShape,
    brain: BrainShape,
    skin: SkinShape,
    noise: f64,
}

impl Draw {
    fn new(seed: u64) -> Self {
        let mut r = Random::new(seed);
        let size = r.between(0.95, 1.04);
        let scales = core::array::from_fn(|_| size * r.between(0.98, 1.02));
        let turns = core::array::from_fn(|_| r.between(-8.0, 8.0));
        let offset = core::array::from_fn(|_| r.between(-15.0, 15.0));
        let width = r.between(0.85, 1.45);
        let uneven = r.between(-0.08, 0.08);
        let ventricles = VentricleShape {
            width: [width * (1.0 + uneven), width * (1.0 - uneven)],
            septum_half: r.between(0.8, 1.3),
            third_half: r.between(2.4, 3.2),
            foramen_radius: r.between(2.2, 2.7),
        };
        let brain = BrainShape {
            csf_gap: r.between(1.8, 3.0),
            sulcus_width: r.between(0.8, 1.8),
            fold_phase: core::array::from_fn(|_| r.between(0.0, 30.0)),
        };
        let skin = SkinShape { scalp: r.between(5.5, 7.5), nose: r.between(0.8, 1.2) };
        Self { scales, turns, offset, ventricles, brain, skin, noise: r.between(6.0, 10.0) }
    }
}

impl HeadModel {
    /// The head of a seed; what the options fix replaces what the seed drew.
    pub fn new(options: &HeadOptions) -> Self {
        let mut draw = Draw::new(options.seed);
        if let Some(width) = options.ventricle_width {
            let mean = 0.5 * (draw.ventricles.width[0] + draw.ventricles.width[1]);
            draw.ventricles.width = draw.ventricles.width.map(|w| w * width / mean);
        }
        if let Some(septum) = options.septum_mm {
            draw.ventricles.septum_half = 0.5 * septum;
        }
        let turns = options.turn_deg.unwrap_or(draw.turns);
        let patient_from_head = placement(draw.scales, turns, draw.offset);
        let fallback = Affine::new(Matrix3::IDENTITY, [0.0; 3]);
        Self {
            patient_from_head,
            // Scales are near 1 and rotations proper: the inverse exists.
            head_from_patient: patient_from_head.inverse().unwrap_or(fallback),
            scale: draw.scales.iter().product::<f64>().cbrt(),
            noise_hu: options.noise_hu.unwrap_or(draw.noise),
            ventricles: Ventricles::new(draw.ventricles),
            brain: BrainShape {
                sulcus_width: options.sulcus_width_mm.unwrap_or(draw.brain.sulcus_width),
                ..draw.brain
            },
            skin: draw.skin,
            head_rest: options.head_rest,
        }
    }

    /// The structure at a point.
    pub fn structure_at(&self, p: Point<Patient>) -> Structure {
        self.sample(self.head(p), 1.0).0.structure
    }

    /// The density in HU at a point without noise, edges blended over `blur` mm as a scanner does.
    pub fn hounsfield_at(&self, p: Point<Patient>, blur: f64) -> f64 {
        self.sample(self.head(p), blur / self.scale).0.hounsfield
    }

    /// Distance to the surface of the nearest ventricle (left, right or third).
    pub fn ventricle_distance(&self, p: Point<Patient>) -> f64 {
        self.ventricles.distances(self.head(p)).whole * self.scale
    }

    /// Distance to the surface of one ventricle; `None` for other structures.
    pub fn distance_to(&self, ventricle: Structure, p: Point<Patient>) -> Option<f64> {
        let d = self.ventricles.distances(self.head(p));
        let of = match ventricle {
            Structure::LeftLateralVentricle => d.left,
            Structure::RightLateralVentricle => d.right,
            Structure::ThirdVentricle => d.third,
            _ => return None,
        };
        Some(of * self.scale)
    }

    /// Distance to the skin.
    pub fn skin_distance(&self, p: Point<Patient>) -> f64 {
        self.skin_at(self.head(p)) * self.scale
    }

    /// Distance to the skin in the head's frame.
    pub(super) fn skin_at(&self, q: At) -> f64 {
        self.skin.distance(q, cranium::skull(q, cranium::cavity(q)))
    }

    /// A point of the head's own frame (origin between the foramina of Monro, x left, y back, z up) in the patient's.
    pub(super) fn patient(&self, p: At) -> Point<Patient> {
        self.patient_from_head.point(p)
    }

    pub(super) fn head(&self, p: Point<Patient>) -> At {
        self.head_from_patient.point(p)
    }

    fn soft_tissue(&self, q: At, skin: f64, paint: &mut Painter) {
        paint.layer(skin, 45.0, Structure::Scalp);
        paint.tint(skin + 1.8, -95.0);
        paint.tint(skin + 1.8 + skin::fat_thickness(q), 52.0);
    }

    /// Bones, orbits and air spaces; what would stand out of the skin is cut off under it.
    fn bone(q: At, [cavity, skull, skin]: [f64; 3], paint: &mut Painter) {
        if q.z < 12.0 {
            let face = cranium::face_bones(q).max(skin + 3.0);
            paint.layer(face, 1000.0, Structure::Skull);
            paint.tint(face + 2.5, 450.0);
        }
        paint.layer(skull, 1350.0, Structure::Skull);
        paint.tint((skull + 2.0).max(1.8 - cavity), 600.0);
        if q.z < 0.0 {
            paint.layer(cranium::base(q).max(-cavity).max(skin + 3.0), 1000.0, Structure::Skull);
            Self::orbit(q, skin, paint);
            paint.layer(cranium::air(q).max(skin), -1000.0, Structure::Scalp);
        }
    }

    fn orbit(q: At, skin: f64, paint: &mut Painter) {
        let lid = skin + 1.8;
        let cone = cranium::orbit(q).max(-72.0 - q.y).max(lid);
        if cone < paint.blur() || q.y < -50.0 {
            let [ball, lens, cords] = skin::eye(q);
            paint.layer(cone, -85.0, Structure::Scalp);
            paint.tint(cords.max(cone), 35.0);
            paint.tint(ball.max(lid), 30.0);
            paint.tint((ball + 1.2).max(lid), 8.0);
            paint.tint(lens.max(lid), 75.0);
        }
    }

    /// What fills the cavity. Below the foramen magnum it is the spinal canal, which is not intracranial.
    fn contents(&self, p: At, q: At, cavity: f64, paint: &mut Painter) {
        paint.layer(cavity, 8.0, Structure::Csf);
        paint.tint(dura(q, cavity), 55.0);
        let ventricles = self.ventricles.distances(p);
        let brain = self.brain.distance(p, cavity, ventricles.whole);
        paint.layer(brain, 38.0, Structure::Brain);
        paint.tint(brain + 3.4, 29.0);
        if q.z.abs() < 40.0 && q.x < 45.0 {
            paint.tint(deep_grey(q).min(caudate_head(q)), 36.0);
            paint.tint(ventricles.whole, 5.0);
            paint.structure = ventricles.structure().unwrap_or(paint.structure);
            paint.tint(calcification(q), 140.0);
        }
        if q.z < FORAMEN_MAGNUM_Z && cavity < 0.0 {
            paint.structure = Structure::Scalp;
        }
    }
}

impl Model for HeadModel {
    fn to_model(&self) -> &Affine<Head, Patient> {
        &self.head_from_patient
    }

    fn blur_scale(&self) -> f64 {
        1.0 / self.scale
    }

    fn sample(&self, p: At, blur: f64) -> (Painter, f64) {
        let q = folded(p);
        let mut paint = Painter::new(blur);
        let cavity = cranium::cavity(p);
        if cavity > -blur.max(4.0) {
            let skull = cranium::skull(q, cavity);
            let skin = self.skin.distance(q, skull);
            if self.head_rest {
                paint.layer(skin::head_rest(q), -250.0, Structure::Outside);
            }
            if skin > blur {
                let clear = if q.y > 30.0 { 0.0 } else { skin.min(35.0 - q.y) };
                return (paint, clear);
            }
            self.soft_tissue(q, skin, &mut paint);
            Self::bone(q, [cavity, skull, skin], &mut paint);
        }
        if cavity < blur {
            self.contents(p, q, cavity, &mut paint);
        }
        (paint, 0.0)
    }
}

/// Scales, then turns about the patient's x, y and z axes (degrees), then moves (mm).
fn placement(scales: [f64; 3], turns: [f64; 3], offset: [f64; 3]) -> Affine<Patient, Head> {
    let mut linear = Matrix3 { rows: [[scales[0], 0.0, 0.0], [0.0, scales[1], 0.0], [0.0, 0.0, scales[2]]] };
    for (axis, degrees) in turns.into_iter().enumerate() {
        let mut direction = [0.0; 3];
        direction[axis] = 1.0;
        let direction = Vector::<Patient>::from_array(direction);
        if let Some(turn) =
            Rigid::<Patient, Patient>::from_axis_angle(direction, f64::to_radians(degrees), Vector::ZERO)
        {
            linear = turn.rotation().times(&linear);
        }
    }
    Affine::new(linear, offset)
}
