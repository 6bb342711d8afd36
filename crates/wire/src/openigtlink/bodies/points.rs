//! POINT and TRAJ: marked places and paths.

use crate::openigtlink::content::{Fault, field};
use crate::openigtlink::{IgtlError, R, W};

/// One element of a POINT message. Coordinates in mm, RAS by convention.
#[derive(Debug, Clone, PartialEq)]
pub struct PointElement {
    /// Name, at most 64 bytes.
    pub name: String,
    /// Group such as `Fiducial`, at most 32 bytes.
    pub group: String,
    /// Colour.
    pub rgba: [u8; 4],
    /// mm.
    pub position: [f32; 3],
    /// mm.
    pub diameter: f32,
    /// The device whose coordinate frame is meant, at most 20 bytes; may be empty.
    pub owner: String,
}

impl PointElement {
    pub(in crate::openigtlink) fn decode(r: &mut R<'_>) -> Result<Self, Fault> {
        Ok(Self {
            name: r.fixed_text(64, "point name")?,
            group: r.fixed_text(32, "point group")?,
            rgba: r.array("colour")?,
            position: r.floats("point position")?,
            diameter: r.f32("point diameter")?,
            owner: r.fixed_text(20, "point owner")?,
        })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        field(w, "point name", &self.name, 64)?;
        field(w, "point group", &self.group, 32)?;
        w.bytes(&self.rgba);
        w.floats(&self.position);
        w.f32(self.diameter);
        field(w, "point owner", &self.owner, 20)
    }
}

/// Which ends of a trajectory are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrajectoryKind {
    /// 1: the entry only.
    Entry,
    /// 2: the target only.
    Target,
    /// 3: both.
    Both,
}

impl TrajectoryKind {
    const fn code(self) -> u8 {
        match self {
            Self::Entry => 1,
            Self::Target => 2,
            Self::Both => 3,
        }
    }

    fn from_code(code: u8) -> Result<Self, Fault> {
        match code {
            1 => Ok(Self::Entry),
            2 => Ok(Self::Target),
            3 => Ok(Self::Both),
            other => Err(Fault::Value { field: "trajectory type", value: other.into() }),
        }
    }
}

/// One element of a TRAJ message. Coordinates in mm, RAS by convention.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Name, at most 64 bytes.
    pub name: String,
    /// Group, at most 32 bytes.
    pub group: String,
    /// Which ends are meant.
    pub kind: TrajectoryKind,
    /// Colour.
    pub rgba: [u8; 4],
    /// mm.
    pub entry: [f32; 3],
    /// mm.
    pub target: [f32; 3],
    /// mm.
    pub diameter: f32,
    /// The device whose coordinate frame is meant, at most 20 bytes; may be empty.
    pub owner: String,
}

impl Trajectory {
    pub(in crate::openigtlink) fn decode(r: &mut R<'_>) -> Result<Self, Fault> {
        let (name, group) = (r.fixed_text(64, "trajectory name")?, r.fixed_text(32, "trajectory group")?);
        let kind = TrajectoryKind::from_code(r.u8("trajectory type")?)?;
        r.u8("padding")?;
        Ok(Self {
            name,
            group,
            kind,
            rgba: r.array("colour")?,
            entry: r.floats("trajectory entry")?,
            target: r.floats("trajectory target")?,
            diameter: r.f32("trajectory diameter")?,
            owner: r.fixed_text(20, "trajectory owner")?,
        })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        field(w, "trajectory name", &self.name, 64)?;
        field(w, "trajectory group", &self.group, 32)?;
        w.u8(self.kind.code());
        w.u8(0);
        w.bytes(&self.rgba);
        w.floats(&self.entry);
        w.floats(&self.target);
        w.f32(self.diameter);
        field(w, "trajectory owner", &self.owner, 20)
    }
}
