//! From metres and the streamed up-axis to poses in millimetres, z up.

use super::frame::{Frame, RigidBody};
use crate::{Missing, TimedPose};
use monro_geometry::{Rigid, Tool, Tracker, Vector};

/// A quaternion that is longer or shorter than 1 by more than this is garbled.
const UNIT: f32 = 0.01;

/// Motive's "Up Axis" setting. It is not told on the wire and must be configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UpAxis {
    /// Motive's default.
    #[default]
    Y,
    /// The other choice.
    Z,
}

impl UpAxis {
    /// The name in URLs: `y` or `z`.
    pub fn parse(text: &str) -> Option<Self> {
        match text {
            "y" | "Y" => Some(Self::Y),
            "z" | "Z" => Some(Self::Z),
            _ => None,
        }
    }

    /// The rotation that turns streamed coordinates into the tracker frame, whose z is up.
    fn tracker_from_streamed(self) -> Rigid<Tracker, Tracker> {
        match self {
            Self::Z => Rigid::IDENTITY,
            // A quarter turn about x: (x, y, z) becomes (x, -z, y). A quaternion of length one is never refused.
            Self::Y => {
                let half = core::f64::consts::FRAC_1_SQRT_2;
                Rigid::from_quaternion([half, half, 0.0, 0.0], Vector::ZERO).unwrap_or(Rigid::IDENTITY)
            }
        }
    }

    /// A streamed pose (metres) in the tracker frame (millimetres, z up); none where the quaternion is no rotation.
    pub(super) fn pose(self, position: [f32; 3], [x, y, z, w]: [f32; 4]) -> Option<Rigid<Tracker, Tool>> {
        let length = [x, y, z, w].iter().map(|v| v * v).sum::<f32>().sqrt();
        if !(1.0 - UNIT..=1.0 + UNIT).contains(&length) {
            return None;
        }
        let mm = Vector::from_array(position.map(|v| f64::from(v) * 1000.0));
        let streamed = Rigid::<Tracker, Tool>::from_quaternion([w, x, y, z].map(f64::from), mm)?;
        Some(self.tracker_from_streamed().after(&streamed))
    }

    /// The streamed position (m) and orientation of a pose: the inverse of [`Self::pose`].
    pub(super) fn streamed(self, pose: &Rigid<Tracker, Tool>) -> ([f32; 3], [f32; 4]) {
        let streamed = self.tracker_from_streamed().inverse().after(pose);
        let [w, x, y, z] = streamed.quaternion_wxyz();
        (streamed.translation().to_array().map(|v| (v / 1000.0) as f32), [x, y, z, w].map(|v| v as f32))
    }
}

impl RigidBody {
    /// A body as the fake Motive sends it; lost when `pose` is `None`.
    pub fn from_pose(id: i32, pose: Option<&Rigid<Tracker, Tool>>, error_mm: f64, up: UpAxis) -> Self {
        let (position, quaternion_xyzw) = pose.map_or(([0.0; 3], [0.0, 0.0, 0.0, 1.0]), |p| up.streamed(p));
        let error = if pose.is_some() { (error_mm / 1000.0) as f32 } else { 0.0 };
        Self { id, position, quaternion_xyzw, markers: Vec::new(), error, params: Some(u16::from(pose.is_some())) }
    }

    /// Whether the server tracked it. Before 2.6 there is no flag: there a mean error of exactly 0 (which no real
    /// measurement has) counts as lost.
    pub fn is_tracked(&self) -> bool {
        self.params.map_or(self.error != 0.0, |p| p & 1 != 0)
    }
}

impl Frame {
    /// The poses of all rigid bodies. `name` gives the name of a streaming id; `frequency` is the server's clock.
    pub(super) fn poses(
        &self,
        up: UpAxis,
        frequency: Option<u64>,
        arrival: f64,
        name: impl Fn(i32) -> String,
    ) -> Vec<TimedPose> {
        let time = self.source_time(frequency);
        let one = |b: &RigidBody| {
            let pose = match up.pose(b.position, b.quaternion_xyzw) {
                _ if !b.is_tracked() => Err(Missing::NotTracked),
                None => Err(Missing::NotRigid),
                Some(pose) => Ok((pose, Some(f64::from(b.error) * 1000.0))),
            };
            TimedPose::new(name(b.id), time, arrival, pose)
        };
        self.rigid_bodies.iter().map(one).collect()
    }

    /// When the frame was exposed, in seconds of the server's clock. The server's `timestamp` is no substitute: it
    /// counts from another start, and echo exchanges do not synchronise it.
    pub fn source_time(&self, frequency: Option<u64>) -> Option<f64> {
        let f = frequency.filter(|&f| f > 0)?;
        (self.suffix.mid_exposure > 0).then(|| self.suffix.mid_exposure as f64 / f as f64)
    }

    /// Exposure to transmission, s; before 3.0 the software latency alone.
    pub fn system_latency(&self, frequency: Option<u64>) -> Option<f64> {
        let s = &self.suffix;
        match frequency.filter(|&f| f > 0 && s.mid_exposure > 0) {
            Some(f) => Some(s.transmitted.checked_sub(s.mid_exposure)? as f64 / f as f64),
            None => (s.latency > 0.0).then(|| s.latency.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OpenIGTLink refused what NatNet took for a rotation, by its direction.
    #[test]
    fn a_quaternion_that_is_no_rotation_is_no_pose() {
        let of = |length: f32| UpAxis::Y.pose([0.1, 0.2, 0.3], [0.0, 0.6 * length, 0.0, 0.8 * length]);
        assert!([1.0, -1.0, 1.0 + 1e-4, 0.995].iter().all(|l| of(*l).is_some()));
        assert!([0.001, 0.9, 1.1, -3.0, 100.0, 0.0, f32::NAN, f32::INFINITY].iter().all(|l| of(*l).is_none()));
    }
}
