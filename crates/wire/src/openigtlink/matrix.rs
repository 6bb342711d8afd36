//! The 3 x 4 matrix of OpenIGTLink, and its RAS axes.

use super::{R, W};
use crate::ReadError;
use monro_geometry::{Frame, Matrix3, Patient, Point, Rigid, Vector};

/// RAS patient axes (x right, y front, z head): OpenIGTLink's own. Elsewhere in this project the patient frame is LPS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ras;

impl Frame for Ras {
    const NAME: &'static str = "ras";
}

/// The half turn about z that takes LPS patient coordinates to RAS.
pub fn ras_from_patient() -> Rigid<Ras, Patient> {
    // A quaternion of length one is never refused.
    Rigid::from_quaternion([0.0, 0.0, 0.0, 1.0], Vector::ZERO).unwrap_or(Rigid::IDENTITY)
}

/// A patient point as the three single-precision RAS numbers of a message.
pub fn ras_of(p: Point<Patient>) -> [f32; 3] {
    [-p.x as f32, -p.y as f32, p.z as f32]
}

/// The patient point of three RAS numbers of a message.
pub fn patient_of([x, y, z]: [f32; 3]) -> Point<Patient> {
    Point::new(-f64::from(x), -f64::from(y), f64::from(z))
}

/// The upper three rows of a homogeneous matrix, column by column: the axes, then the translation in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matrix34 {
    /// Columns of the rotation, then the translation.
    pub columns: [[f32; 3]; 4],
}

impl Matrix34 {
    /// No rotation, no translation.
    pub const IDENTITY: Self = Self { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };

    /// From a rigid transform.
    pub fn from_rigid<To, From>(rigid: &Rigid<To, From>) -> Self {
        let (r, t) = (rigid.rotation(), rigid.translation().to_array());
        let columns = [r.column(0), r.column(1), r.column(2), t].map(|c| c.map(|v| v as f32));
        Self { columns }
    }

    /// As a rigid transform; `None` when it is none (scaled, sheared, mirrored, not finite).
    pub fn to_rigid<To, From>(&self) -> Option<Rigid<To, From>> {
        let [a, b, c, t] = self.columns.map(|c| Vector::<To>::from_array(c.map(f64::from)));
        Rigid::from_matrix(&Matrix3::from_columns(a, b, c), t)
    }

    pub(super) fn decode(r: &mut R<'_>) -> Result<Self, ReadError> {
        let mut columns = [[0.0; 3]; 4];
        for c in &mut columns {
            *c = r.floats("matrix")?;
        }
        Ok(Self { columns })
    }

    pub(super) fn encode(&self, w: &mut W) {
        self.columns.iter().for_each(|c| w.floats(c));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Tool, Tracker};

    #[test]
    fn the_half_turn_maps_points_as_the_borders_do() {
        let p = Point::<Patient>::new(10.0, -20.0, 30.0);
        assert!(ras_from_patient().point(p).distance(Point::new(-10.0, 20.0, 30.0)) < 1e-12);
        assert_eq!(patient_of(ras_of(p)), p);
    }

    #[test]
    fn a_scaled_or_mirrored_matrix_is_no_pose() {
        let mut m = Matrix34::IDENTITY;
        assert!(m.to_rigid::<Tracker, Tool>().is_some());
        m.columns[0][0] = -1.0;
        assert!(m.to_rigid::<Tracker, Tool>().is_none());
        m.columns[0][0] = 1.1;
        assert!(m.to_rigid::<Tracker, Tool>().is_none());
        m = Matrix34::IDENTITY;
        m.columns[3][1] = f32::NAN;
        assert!(m.to_rigid::<Tracker, Tool>().is_none());
    }
}
