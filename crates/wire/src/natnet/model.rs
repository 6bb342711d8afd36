//! MODELDEF: what is streamed, by name.

use super::frame::Vec3;
use super::message::datagram;
use super::{MessageId, NatNetError, R, Version, W};
use crate::ReadError;

/// A marker of a rigid body's definition (since 3.0).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MarkerDefinition {
    /// Name (since 4.0).
    pub name: String,
    /// Place in the body's frame, m.
    pub offset: Vec3,
    /// Required active label, 0 for a passive marker.
    pub active_label: i32,
}

/// A rigid body's definition.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RigidBodyDefinition {
    /// Name.
    pub name: String,
    /// Streaming id.
    pub id: i32,
    /// Parent's id, -1 for none.
    pub parent: i32,
    /// Offset to the parent, m.
    pub offset: Vec3,
    /// Rotation offset x, y, z, w (since 4.2).
    pub rotation_xyzw: [f32; 4],
    /// Its markers (since 3.0): compare them with those that the tool was calibrated with.
    pub markers: Vec<MarkerDefinition>,
}

/// What is streamed. Definitions that guidance does not need are known by their type number only.
#[derive(Debug, Clone, PartialEq)]
pub enum Definition {
    /// Type 0.
    MarkerSet {
        /// Name.
        name: String,
        /// Names of its markers.
        markers: Vec<String>,
    },
    /// Type 1.
    RigidBody(RigidBodyDefinition),
    /// Type 2.
    Skeleton {
        /// Name.
        name: String,
        /// Id.
        id: i32,
        /// Bones.
        bones: Vec<RigidBodyDefinition>,
    },
    /// Type 5 (since 3.0).
    Camera {
        /// Name.
        name: String,
        /// Position, m.
        position: Vec3,
        /// Orientation x, y, z, w.
        quaternion_xyzw: [f32; 4],
    },
    /// Any other type; its content is skipped.
    Other(i32),
}

/// Reads the payload of MODELDEF. Before 4.1 an unknown type ends the reading: what came before it is kept.
///
/// # Errors
/// When a count or a size contradicts the bytes present.
pub fn definitions(payload: &[u8], v: Version) -> Result<Vec<Definition>, NatNetError> {
    let mut r = R::new(payload);
    let named = |source| NatNetError::Read { message: "model definition", version: v, source };
    let n = r.count(4, "definitions").map_err(named)?;
    let mut all = Vec::new();
    for _ in 0..n {
        let kind = r.i32("definition type").map_err(named)?;
        let definition = if v.since(4, 1) { sized(&mut r, kind, v) } else { body(&mut r, kind, v) };
        let definition = definition.map_err(named)?;
        let blind = !v.since(4, 1) && matches!(definition, Definition::Other(_));
        all.push(definition);
        if blind {
            break;
        }
    }
    Ok(all)
}

fn sized(r: &mut R<'_>, kind: i32, v: Version) -> Result<Definition, ReadError> {
    let size = r.count(1, "definition size")?;
    body(&mut R::new(r.take(size, "definition")?), kind, v)
}

fn body(r: &mut R<'_>, kind: i32, v: Version) -> Result<Definition, ReadError> {
    Ok(match kind {
        0 => {
            let name = r.c_text("marker set name")?;
            let n = r.count(1, "marker names")?;
            Definition::MarkerSet { name, markers: r.many(n, |r| r.c_text("marker name"))? }
        }
        1 => Definition::RigidBody(rigid_body(r, v)?),
        2 => {
            let (name, id) = (r.c_text("skeleton name")?, r.i32("skeleton id")?);
            let n = r.count(20, "bones")?;
            Definition::Skeleton { name, id, bones: r.many(n, |r| rigid_body(r, v))? }
        }
        3 if !v.since(4, 1) => force_plate(r)?,
        4 if !v.since(4, 1) => device(r)?,
        5 if v.since(3, 0) => Definition::Camera {
            name: r.c_text("camera name")?,
            position: r.floats("camera position")?,
            quaternion_xyzw: r.floats("camera orientation")?,
        },
        other => Definition::Other(other),
    })
}

/// Read over: before 4.1 nothing else tells where the next definition begins.
fn force_plate(r: &mut R<'_>) -> Result<Definition, ReadError> {
    r.i32("force plate id")?;
    r.c_text("force plate serial")?;
    // Width, length, origin, 12 x 12 calibration, four corners; plate type and data type.
    r.take(4 * (2 + 3 + 144 + 12 + 2), "force plate")?;
    channel_names(r)?;
    Ok(Definition::Other(3))
}

fn device(r: &mut R<'_>) -> Result<Definition, ReadError> {
    r.i32("device id")?;
    r.c_text("device name")?;
    r.c_text("device serial")?;
    r.take(8, "device types")?;
    channel_names(r)?;
    Ok(Definition::Other(4))
}

fn channel_names(r: &mut R<'_>) -> Result<(), ReadError> {
    let n = r.count(1, "channel names")?;
    (0..n).try_for_each(|_| r.c_text("channel name").map(drop))
}

fn rigid_body(r: &mut R<'_>, v: Version) -> Result<RigidBodyDefinition, ReadError> {
    let mut b = RigidBodyDefinition {
        name: r.c_text("rigid body name")?,
        id: r.i32("rigid body id")?,
        parent: r.i32("parent id")?,
        offset: r.floats("offset to parent")?,
        rotation_xyzw: if v.since(4, 2) { r.floats("rotation offset")? } else { [0.0, 0.0, 0.0, 1.0] },
        markers: Vec::new(),
    };
    if !v.since(3, 0) {
        return Ok(b);
    }
    let n = r.count(16, "markers of a rigid body")?;
    b.markers = r.many(n, |r| {
        Ok::<_, ReadError>(MarkerDefinition { offset: r.floats("marker offset")?, ..MarkerDefinition::default() })
    })?;
    for m in &mut b.markers {
        m.active_label = r.i32("active label")?;
    }
    if v.since(4, 0) {
        for m in &mut b.markers {
            m.name = r.c_text("marker name")?;
        }
    }
    Ok(b)
}

impl Definition {
    fn encode(&self, w: &mut W, v: Version) {
        let mut inner = W::new();
        let kind = match self {
            Self::MarkerSet { name, markers } => {
                inner.c_text(name);
                inner.count(markers.len());
                markers.iter().for_each(|m| inner.c_text(m));
                0
            }
            Self::RigidBody(b) => {
                put_rigid_body(&mut inner, b, v);
                1
            }
            Self::Skeleton { name, id, bones } => {
                inner.c_text(name);
                inner.i32(*id);
                inner.count(bones.len());
                bones.iter().for_each(|b| put_rigid_body(&mut inner, b, v));
                2
            }
            Self::Camera { name, position, quaternion_xyzw } => {
                inner.c_text(name);
                inner.floats(position);
                inner.floats(quaternion_xyzw);
                5
            }
            Self::Other(kind) => *kind,
        };
        w.i32(kind);
        if v.since(4, 1) {
            w.count(inner.0.len());
        }
        w.bytes(&inner.0);
    }
}

fn put_rigid_body(w: &mut W, b: &RigidBodyDefinition, v: Version) {
    w.c_text(&b.name);
    w.i32(b.id);
    w.i32(b.parent);
    w.floats(&b.offset);
    if v.since(4, 2) {
        w.floats(&b.rotation_xyzw);
    }
    if v.since(3, 0) {
        w.count(b.markers.len());
        b.markers.iter().for_each(|m| w.floats(&m.offset));
        b.markers.iter().for_each(|m| w.i32(m.active_label));
    }
    if v.since(4, 0) {
        b.markers.iter().for_each(|m| w.c_text(&m.name));
    }
}

/// The datagram of MODELDEF.
pub(super) fn encode(definitions: &[Definition], v: Version) -> Vec<u8> {
    let mut w = W::new();
    w.count(definitions.len());
    definitions.iter().for_each(|d| d.encode(&mut w, v));
    datagram(MessageId::ModelDefinition, &w.0)
}
