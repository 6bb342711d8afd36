//! POSITION, TDATA, QTDATA: poses.

use crate::openigtlink::content::{Fault, field};
use crate::openigtlink::matrix::Matrix34;
use crate::openigtlink::{IgtlError, R, W};
use monro_geometry::{Rigid, Vector};

/// A position in mm with an optional orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// mm.
    pub position: [f32; 3],
    /// x, y, z, w; `None` when the sender gives no orientation.
    pub quaternion_xyzw: Option<[f32; 4]>,
}

impl Position {
    /// From a rigid transform.
    pub fn from_rigid<To, From>(rigid: &Rigid<To, From>) -> Self {
        let (position, quaternion) = parts(rigid);
        Self { position, quaternion_xyzw: Some(quaternion) }
    }

    /// As a rigid transform; `None` without an orientation, when its quaternion is not of length 1, or when not finite.
    pub fn to_rigid<To, From>(&self) -> Option<Rigid<To, From>> {
        rigid(self.position, self.quaternion_xyzw?)
    }

    pub(in crate::openigtlink) fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let mut r = R::new(bytes);
        let quaternion = |r: &mut R<'_>| -> Result<Option<[f32; 4]>, Fault> {
            Ok(match bytes.len() {
                12 => None,
                24 => {
                    let v: [f32; 3] = r.floats("quaternion")?;
                    let rest = 1.0 - v.iter().map(|c| c * c).sum::<f32>();
                    Some([v[0], v[1], v[2], rest.max(0.0).sqrt()])
                }
                28 => Some(r.floats("quaternion")?),
                size => return Err(Fault::Size { size, expected: "12, 24 or 28".to_owned() }),
            })
        };
        let position = r.floats("position")?;
        Ok(Self { position, quaternion_xyzw: quaternion(&mut r)? })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) {
        w.floats(&self.position);
        if let Some(q) = self.quaternion_xyzw {
            w.floats(&q);
        }
    }
}

/// What kind of thing a tracking element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstrumentKind {
    /// 1: the tracker itself.
    Tracker,
    /// 2: an instrument with six degrees of freedom.
    Instrument6D,
    /// 3: a position only.
    Instrument3D,
    /// 4: a position and an axis.
    Instrument5D,
    /// A number not in the list.
    Other(u8),
}

impl InstrumentKind {
    /// Whether its orientation is one: of a position alone the rest is filler.
    pub const fn is_turned(self) -> bool {
        !matches!(self, Self::Instrument3D)
    }

    const fn from_code(code: u8) -> Self {
        match code {
            1 => Self::Tracker,
            2 => Self::Instrument6D,
            3 => Self::Instrument3D,
            4 => Self::Instrument5D,
            other => Self::Other(other),
        }
    }

    const fn code(self) -> u8 {
        match self {
            Self::Tracker => 1,
            Self::Instrument6D => 2,
            Self::Instrument3D => 3,
            Self::Instrument5D => 4,
            Self::Other(code) => code,
        }
    }
}

/// One tool of a TDATA message.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackingElement {
    /// Name, at most 20 bytes.
    pub name: String,
    /// What it is.
    pub kind: InstrumentKind,
    /// Its pose.
    pub matrix: Matrix34,
}

impl TrackingElement {
    pub(in crate::openigtlink) fn decode(r: &mut R<'_>) -> Result<Self, Fault> {
        let (name, kind) = name_and_kind(r)?;
        Ok(Self { name, kind, matrix: Matrix34::decode(r)? })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        put_name_and_kind(w, &self.name, self.kind)?;
        self.matrix.encode(w);
        Ok(())
    }
}

/// One tool of a QTDATA message.
#[derive(Debug, Clone, PartialEq)]
pub struct QuaternionElement {
    /// Name, at most 20 bytes.
    pub name: String,
    /// What it is.
    pub kind: InstrumentKind,
    /// mm.
    pub position: [f32; 3],
    /// x, y, z, w.
    pub quaternion_xyzw: [f32; 4],
}

impl QuaternionElement {
    /// From a rigid transform.
    pub fn from_rigid<To, From>(name: impl Into<String>, rigid: &Rigid<To, From>) -> Self {
        let (position, quaternion_xyzw) = parts(rigid);
        Self { name: name.into(), kind: InstrumentKind::Instrument6D, position, quaternion_xyzw }
    }

    /// As a rigid transform; `None` when the quaternion is not of length 1 (to a hundredth) or anything is not finite.
    pub fn to_rigid<To, From>(&self) -> Option<Rigid<To, From>> {
        rigid(self.position, self.quaternion_xyzw)
    }

    pub(in crate::openigtlink) fn decode(r: &mut R<'_>) -> Result<Self, Fault> {
        let (name, kind) = name_and_kind(r)?;
        Ok(Self { name, kind, position: r.floats("position")?, quaternion_xyzw: r.floats("quaternion")? })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        put_name_and_kind(w, &self.name, self.kind)?;
        w.floats(&self.position);
        w.floats(&self.quaternion_xyzw);
        Ok(())
    }
}

fn name_and_kind(r: &mut R<'_>) -> Result<(String, InstrumentKind), Fault> {
    let name = r.fixed_text(20, "tool name")?;
    let kind = InstrumentKind::from_code(r.u8("tool type")?);
    r.u8("padding")?;
    Ok((name, kind))
}

fn put_name_and_kind(w: &mut W, name: &str, kind: InstrumentKind) -> Result<(), IgtlError> {
    field(w, "tool name", name, 20)?;
    w.u8(kind.code());
    w.u8(0);
    Ok(())
}

fn parts<To, From>(rigid: &Rigid<To, From>) -> ([f32; 3], [f32; 4]) {
    let [w, x, y, z] = rigid.quaternion_wxyz();
    (rigid.translation().to_array().map(|v| v as f32), [x, y, z, w].map(|v| v as f32))
}

/// Quaternions whose length is off by more than this are none: what is sent is something else.
const UNIT: f64 = 0.01;

fn rigid<To, From>(position: [f32; 3], [x, y, z, w]: [f32; 4]) -> Option<Rigid<To, From>> {
    let length = [x, y, z, w].iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    if (length - 1.0).abs().is_nan() || (length - 1.0).abs() > UNIT {
        return None;
    }
    Rigid::from_quaternion([w, x, y, z].map(f64::from), Vector::from_array(position.map(f64::from)))
}
