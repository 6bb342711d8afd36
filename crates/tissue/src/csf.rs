//! Cerebrospinal fluid as an input: a pressure in all fluid regions, or a volume drained from them.
//!
//! The fluid regions are one communicating space. A pressure `p` above that at rest adds `-p dV` to the energy, so it pushes
//! the walls along the gradient of the space's volume and follows them. The solver takes it as it takes the tissue's own
//! pressures, through the volume of each fluid element: where fluid and tissue press on each other, what both do to a wall
//! that moves along itself cancels, at any pressure. (As a force set at the start of a step it did not: walls folded from
//! 30 mmHg on.) A drained volume is a condition on that volume; its multiplier is the pressure, found by integral control over
//! the substeps with the stiffness of a cavity in a wide elastic solid, `dp = 4/3 mu dV / V` (Lame), as the gain. Suction has
//! a bound, for the model does not know where walls meet.
//!
//! Fluid at rest under gravity has more pressure below than above, by its density times gravity for each millimetre: what is
//! in it and as heavy floats. Its pressure is given and reported where the middle of the fluid is at rest. Nodes weigh what
//! lies around them at rest; fluid that has left since weighs nothing, and what has come in its weight.

use crate::bytes;
use crate::fast::Row;
use crate::options::MOST_PRESSURE_KPA;
use crate::vec3::{V3, add, cross, dot, scale, six_volume, sub, xyz};
use crate::{Csf, Model, State};

/// Share of the missing pressure that is added in a 60th of a second.
const GAIN: f64 = 0.15;
/// Most suction that draining may come to over the shear modulus of the tissue: where walls meet, more of it would only pull
/// them through each other. With 3 no element of three heads was turned however much was asked for, with 6 a hundred were.
const MOST_SUCTION: f64 = 3.0;

/// Shear modulus of the solid elements that share a vertex with the fluid, kPa: their median by volume, so that a stiff sheet
/// that reaches the fluid (a dura is ten thousand times stiffer) sets no gain for all. Where none does, of all elements.
fn shear_around(model: &Model, fluid: &[u32]) -> f64 {
    let of = |t: usize| model.material_of(t as u32);
    let mut wet = vec![false; model.rest.len()];
    fluid.iter().flat_map(|&t| model.tets[t as usize]).for_each(|v| wet[v as usize] = true);
    let beside = |t: &usize| !of(*t).fluid && model.tets[*t].iter().any(|&v| wet[v as usize]);
    let weighed = |t: usize| {
        let corners = model.tets[t].map(|v| xyz(model.rest[v as usize]));
        (of(t).shear_kpa(), f64::from(six_volume(corners)))
    };
    let all = 0..model.tets.len();
    let mut found: Vec<(f64, f64)> = all.clone().filter(beside).map(weighed).collect();
    if found.is_empty() {
        found = all.map(weighed).collect();
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = 0.5 * found.iter().map(|f| f.1).sum::<f64>();
    let middle = found.iter().find(|f| {
        left -= f.1;
        left <= 0.0
    });
    middle.or(found.last()).map_or(0.0, |f| f.0)
}

/// Pressure of a fluid above that at rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct FluidPressure {
    /// In its middle, kPa.
    pub(crate) kpa: f32,
    pub(crate) middle: V3,
    /// By how much it rises on each way, kPa/mm.
    pub(crate) rise: V3,
}

impl FluidPressure {
    /// Whether there is none anywhere.
    pub(crate) fn is_none(&self) -> bool {
        self.kpa == 0.0 && self.rise == [0.0; 3]
    }

    /// Pressure at the place `x`, kPa.
    pub(crate) fn at(&self, x: V3) -> f32 {
        self.kpa + dot(self.rise, sub(x, self.middle))
    }
}

/// The fluid space: its elements and the stiffness around it.
#[derive(Debug, Clone, Default)]
pub(crate) struct FluidSpace {
    tets: Vec<u32>,
    /// Volume at rest, mm3.
    rest_mm3: f64,
    /// Its middle at rest.
    middle: V3,
    /// Mean density, kg/mm3.
    density: f64,
    /// Shear modulus of the tissue around the fluid, kPa.
    shear_kpa: f64,
}

impl FluidSpace {
    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.tets)
    }

    pub(crate) fn new(model: &Model) -> Self {
        let tets: Vec<u32> = (0..model.tets.len() as u32).filter(|&t| model.material_of(t).fluid).collect();
        let mut out = Self { shear_kpa: shear_around(model, &tets), tets, ..Self::default() };
        out.rest_mm3 = out.volume_mm3(model, &model.rest);
        for &t in &out.tets {
            let corners = model.tets[t as usize].map(|v| xyz(model.rest[v as usize]));
            let share = f64::from(six_volume(corners)) / (6.0 * out.rest_mm3);
            out.middle = add(out.middle, scale(centroid(corners), share as f32));
            out.density += share * model.material_of(t).density_kg_m3 * 1e-9;
        }
        out
    }

    /// Its pressure where that in the middle is `kpa`.
    pub(crate) fn under(&self, kpa: f64, gravity_mm_s2: [f64; 3]) -> FluidPressure {
        let rise = gravity_mm_s2.map(|g| (self.density * g) as f32);
        FluidPressure { kpa: kpa as f32, middle: self.middle, rise }
    }

    fn volume_mm3(&self, model: &Model, positions: &[[f32; 4]]) -> f64 {
        let corners = |&t: &u32| model.tets[t as usize].map(|v| xyz(positions[v as usize]));
        self.tets.iter().map(|t| f64::from(six_volume(corners(t))) / 6.0).sum()
    }

    /// Volume above that at rest, ml, from six times the growth of all elements, mm3.
    pub(crate) fn grown_ml(&self, growth: &[Row]) -> f64 {
        let growth = growth.as_flattened();
        self.tets.iter().map(|&t| f64::from(growth[t as usize])).sum::<f64>() / 6.0 * 1e-3
    }

    /// Volume above that at rest, ml.
    fn change_ml(&self, model: &Model, state: &State) -> f64 {
        if self.tets.is_empty() { 0.0 } else { (self.volume_mm3(model, &state.positions) - self.rest_mm3) * 1e-3 }
    }

    /// Pressure of the next substep of `dt` seconds above that at rest, kPa.
    pub(crate) fn pressure_kpa(&self, model: &Model, state: &State, csf: Csf, dt: f64) -> f64 {
        match csf {
            _ if self.tets.is_empty() => 0.0,
            Csf::AtRest => 0.0,
            Csf::Pressure { kpa } => kpa,
            Csf::Drained { ml } => {
                let missing = -ml - self.change_ml(model, state);
                let stiff = 4.0 / 3.0 * self.shear_kpa / (self.rest_mm3 * 1e-3);
                let gain = 1.0 - (1.0 - GAIN).powf(60.0 * dt);
                (state.csf_kpa + gain * stiff * missing).clamp(-MOST_SUCTION * self.shear_kpa, MOST_PRESSURE_KPA)
            }
        }
    }

    /// Calls `add` with each node of the fluid and its share of the weight of fluid that has come in since rest, or left, mN.
    pub(crate) fn add_weight(
        &self,
        model: &Model,
        positions: &[[f32; 4]],
        pressure: &FluidPressure,
        mut add: impl FnMut(u32, V3),
    ) {
        if pressure.rise == [0.0; 3] {
            return;
        }
        for &t in &self.tets {
            let nodes = model.tets[t as usize];
            let [now, rest] = [positions, &model.rest].map(|at| six_volume(nodes.map(|v| xyz(at[v as usize]))));
            let share = scale(pressure.rise, (now - rest) / 24.0);
            nodes.into_iter().for_each(|node| add(node, share));
        }
    }

    /// Calls `push` with each node of the fluid and its share of the force of this pressure, mN: inside they cancel, or bear
    /// the fluid's weight.
    pub(crate) fn add_forces(
        &self,
        model: &Model,
        positions: &[[f32; 4]],
        pressure: &FluidPressure,
        mut push: impl FnMut(u32, V3),
    ) {
        // Opposite faces seen so that their area vector is six times the gradient of the volume by the corner.
        const OPPOSITE: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];
        for &t in &self.tets {
            let nodes = model.tets[t as usize];
            let p = nodes.map(|v| xyz(positions[v as usize]));
            let kpa = pressure.at(centroid(p));
            for (corner, [a, b, c]) in OPPOSITE.into_iter().enumerate() {
                let area = cross(sub(p[b], p[a]), sub(p[c], p[a]));
                push(nodes[corner], scale(area, kpa / 6.0));
            }
        }
    }
}

fn centroid(corners: [V3; 4]) -> V3 {
    scale(corners.into_iter().fold([0.0; 3], add), 0.25)
}
