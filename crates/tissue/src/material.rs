//! What a region of tissue is made of, with the source of each default.

use thiserror::Error;

/// Constitutive, numerical and insertion parameters of one region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Young's modulus, kPa (physical mode).
    pub young_kpa: f64,
    /// Poisson's ratio, below 0.5 (physical mode).
    pub poisson: f64,
    /// Mass density, kg/m3.
    pub density_kg_m3: f64,
    /// Kelvin-Voigt damping time, s: viscous stress is this times the shear modulus times twice the rate of the strain that
    /// changes shape. Changes of volume, which near-incompressible tissue hardly makes, are not damped. A model has one
    /// damping time, the largest of those of its regions. A time step damps like so long a time by itself, and less than that is
    /// not to be had.
    pub damping_s: f64,
    /// Normalised coefficients of the paper's constraints (paper mode).
    pub paper: PaperCoefficients,
    /// How a tool gets into and through this region.
    pub insertion: Insertion,
    /// Whether the region is a fluid: no membrane between two fluids.
    pub fluid: bool,
    /// Stiffness of the thin membrane that bounds the region (physical mode); `None` for none. A wall to a fluid has the
    /// fluid's, a wall between two solids the stiffer of both.
    pub membrane: Option<ThinMembrane>,
}

/// A membrane thin against the elements beside it: stiff in its plane, without resistance to bending. It stays whole where
/// a tool punctures it: what is torn around a catheter is not modelled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThinMembrane {
    /// Young's modulus, kPa.
    pub young_kpa: f64,
    /// Poisson's ratio, `0..=0.5`.
    pub poisson: f64,
    /// Thickness, mm.
    pub thickness_mm: f64,
}

/// Stiffness of each of the paper's constraints in `0..=1`: 0 does nothing, 1 satisfies the constraint fully each step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperCoefficients {
    /// Edge lengths, equation (6).
    pub stretch: f64,
    /// Dihedral angles, equation (7).
    pub dihedral: f64,
    /// Bending towards the centroid of a triangle, equation (8).
    pub triangle: f64,
    /// Volume of each tetrahedron, equation (10).
    pub volume: f64,
    /// Virtual springs from the centroid to the vertices, equation (11).
    pub hetero: f64,
}

/// Resistance of a region to a rigid rod of 3 mm diameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Insertion {
    /// Axial force at which the membrane that bounds the region is punctured, mN (physical mode).
    pub puncture_force_mn: f64,
    /// Dimple at which the membrane is punctured whatever the force, mm.
    pub puncture_depth_mm: f64,
    /// Force at the tip that cuts the tissue, mN.
    pub cut_force_mn: f64,
    /// Static friction along the shaft, mN per mm of length.
    pub static_friction_mn_per_mm: f64,
    /// Dynamic friction along the shaft, mN per mm of length.
    pub dynamic_friction_mn_per_mm: f64,
}

impl Material {
    /// Brain parenchyma. E 3 kPa and nu 0.49 are the values of surgical simulation (Miller and Wittek; Wittek, Hawkins and
    /// Miller 2009, PMC3224703); density of grey and white matter. The damping time is a choice: it settles the slowest
    /// shear mode of a head (about 8 Hz at 3 kPa) within a few periods.
    pub const BRAIN: Self = Self {
        young_kpa: 3.0,
        poisson: 0.49,
        density_kg_m3: 1040.0,
        damping_s: 0.02,
        paper: PaperCoefficients { stretch: 0.5, dihedral: 0.2, triangle: 0.2, volume: 0.9, hetero: 0.3 },
        insertion: Insertion::BRAIN,
        fluid: false,
        membrane: None,
    };

    /// A ventricle as a very soft, compressible region: E 0.5 kPa and nu 0.3 are a numerical stand-in for a fluid, soft
    /// against the brain and stiff enough to keep its elements upright; density of CSF.
    pub const VENTRICLE: Self = Self {
        young_kpa: 0.5,
        poisson: 0.3,
        density_kg_m3: 1007.0,
        damping_s: 0.02,
        paper: PaperCoefficients { stretch: 0.1, dihedral: 0.05, triangle: 0.05, volume: 0.5, hetero: 0.02 },
        insertion: Insertion::VENTRICLE,
        fluid: true,
        membrane: None,
    };

    /// Falx and tentorium: folds of the dura, as a region of their own (automatic segmentation does not find them). E is the
    /// pooled mean of human cranial dura in tension (68.1 `MPa`, 13 studies: Pearcy et al. 2022, 10.1007/s10237-022-01566-5;
    /// head models mostly take 31.5); nu and density are choices. A catheter is not meant to go through it: its resistance
    /// is a choice, ten times the brain's.
    pub const DURA: Self = Self {
        young_kpa: 68_000.0,
        poisson: 0.45,
        density_kg_m3: 1130.0,
        damping_s: 0.02,
        paper: PaperCoefficients { stretch: 1.0, dihedral: 0.5, triangle: 0.5, volume: 0.9, hetero: 0.5 },
        insertion: Insertion {
            puncture_force_mn: 10.0 * Insertion::BRAIN.puncture_force_mn,
            puncture_depth_mm: 10.0,
            cut_force_mn: 10.0 * Insertion::BRAIN.cut_force_mn,
            ..Insertion::BRAIN
        },
        fluid: false,
        membrane: None,
    };
}

impl ThinMembrane {
    /// Pia: E is of the order found from brain shift between prone and supine positions (1.2 `MPa`, Bennion et al. 2022,
    /// PMC9748497); the thickness and nu are choices.
    pub const PIA: Self = Self { young_kpa: 1200.0, poisson: 0.45, thickness_mm: 0.02 };

    /// Ependyma: one layer of cells without a measured modulus. As stiff as the brain under it, a choice, it adds a
    /// thousandth of what an element of 3 mm has, so ventricles have none unless a study asks for it.
    pub const EPENDYMA: Self = Self { young_kpa: 3.0, poisson: 0.49, thickness_mm: 0.02 };

    fn check(&self) -> Result<(), MaterialFault> {
        positive("membrane.young_kpa", self.young_kpa)?;
        between("membrane.poisson", self.poisson, (0.0..=0.5).contains(&self.poisson), "0 to 0.5")?;
        positive("membrane.thickness_mm", self.thickness_mm)
    }
}

impl Insertion {
    /// Pia and parenchyma. Friction: static and dynamic stand in the ratio of the coefficients that commercial catheter
    /// material has on agarose, 0.295 to 0.255 ("Evaluation of the friction coefficient, the radial stress, and the damage
    /// work during needle insertions into agarose gels"; lower at 0.2 mm/s than at 1.8 and 10 mm/s, which is not modelled).
    /// The level of the friction, the force that cuts and the puncture of the pia are **choices** without a measured source:
    /// of the order of the elastic resistance of the tissue (a bonded 3 mm rod in 3 kPa meets about 0.1 N per mm of drag over
    /// 40 mm of shaft), to be set per study. Peak forces grow with diameter and depend on the tip (Jiang et al. 2014,
    /// J Biomech 47:3344), so these are for a rounded rod of 3 mm only.
    pub const BRAIN: Self = Self {
        puncture_force_mn: 150.0,
        puncture_depth_mm: 5.0,
        cut_force_mn: 80.0,
        static_friction_mn_per_mm: 1.2,
        dynamic_friction_mn_per_mm: 1.04,
    };

    /// Ependyma in front of fluid: yields at a force or a dimple of the same order as the parenchyma's own resistance (a
    /// choice); the fluid itself neither has to be cut nor rubs.
    pub const VENTRICLE: Self = Self {
        puncture_force_mn: 120.0,
        puncture_depth_mm: 4.0,
        cut_force_mn: 0.0,
        static_friction_mn_per_mm: 0.0,
        dynamic_friction_mn_per_mm: 0.0,
    };

    fn check(&self) -> Result<(), MaterialFault> {
        let (fixed, sliding) = (self.static_friction_mn_per_mm, self.dynamic_friction_mn_per_mm);
        not_negative("insertion.puncture_force_mn", self.puncture_force_mn)?;
        not_negative("insertion.puncture_depth_mm", self.puncture_depth_mm)?;
        not_negative("insertion.cut_force_mn", self.cut_force_mn)?;
        not_negative("insertion.static_friction_mn_per_mm", fixed)?;
        not_negative("insertion.dynamic_friction_mn_per_mm", sliding)?;
        let most = format!("at most static_friction_mn_per_mm, which is {fixed}");
        between("insertion.dynamic_friction_mn_per_mm", sliding, sliding <= fixed, &most)
    }
}

impl PaperCoefficients {
    fn check(&self) -> Result<(), MaterialFault> {
        let share = |field, k: f64| between(field, k, (0.0..=1.0).contains(&k), "0 to 1");
        share("paper.stretch", self.stretch)?;
        share("paper.dihedral", self.dihedral)?;
        share("paper.triangle", self.triangle)?;
        share("paper.volume", self.volume)?;
        share("paper.hetero", self.hetero)
    }
}

/// A value of a material that is out of its range.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{field} is {value}, wanted {wanted}")]
pub struct MaterialFault {
    /// Which value, with its part of the material: `insertion.cut_force_mn`.
    pub field: &'static str,
    /// The value.
    pub value: f64,
    /// The allowed range.
    pub wanted: String,
}

fn between(field: &'static str, value: f64, fits: bool, wanted: &str) -> Result<(), MaterialFault> {
    if fits { Ok(()) } else { Err(MaterialFault { field, value, wanted: wanted.to_owned() }) }
}

/// Larger numbers, and smaller ones than one over it, leave the range of single precision when a few of them are multiplied.
const LARGEST: f64 = 1e9;

fn positive(field: &'static str, value: f64) -> Result<(), MaterialFault> {
    between(field, value, (1.0 / LARGEST..=LARGEST).contains(&value), "more than 0 (1e-9 to 1e9)")
}

fn not_negative(field: &'static str, value: f64) -> Result<(), MaterialFault> {
    between(field, value, (0.0..=LARGEST).contains(&value), "0 or more (up to 1e9)")
}

impl Material {
    /// Shear modulus mu = E / (2 (1 + nu)), kPa.
    pub fn shear_kpa(&self) -> f64 {
        self.young_kpa / (2.0 * (1.0 + self.poisson))
    }

    /// First Lamé constant lambda = E nu / ((1 + nu)(1 - 2 nu)), kPa.
    pub fn lame_kpa(&self) -> f64 {
        self.young_kpa * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))
    }

    /// Whether it can be simulated.
    ///
    /// # Errors
    /// The first value that is out of its range.
    pub fn check(&self) -> Result<(), MaterialFault> {
        positive("young_kpa", self.young_kpa)?;
        between("poisson", self.poisson, (0.0..0.4999).contains(&self.poisson), "0 to below 0.4999")?;
        positive("density_kg_m3", self.density_kg_m3)?;
        not_negative("damping_s", self.damping_s)?;
        self.paper.check()?;
        self.insertion.check()?;
        self.membrane.map_or(Ok(()), |m| m.check())
    }
}
