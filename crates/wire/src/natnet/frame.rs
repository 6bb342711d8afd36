//! One frame of data, as it is on the wire.

/// Three coordinates in metres.
pub type Vec3 = [f32; 3];

/// A named set of marker positions.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MarkerSet {
    /// Name; `all` repeats every labeled marker.
    pub name: String,
    /// Positions, m.
    pub markers: Vec<Vec3>,
}

/// A marker of a rigid body (before 3.0).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BodyMarker {
    /// Position, m.
    pub position: Vec3,
    /// Id.
    pub id: i32,
    /// Diameter, m.
    pub size: f32,
}

/// A rigid body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RigidBody {
    /// Streaming id; of a bone, skeleton id << 16 | bone id.
    pub id: i32,
    /// Position, m.
    pub position: Vec3,
    /// Orientation x, y, z, w.
    pub quaternion_xyzw: [f32; 4],
    /// Its markers; empty since 3.0.
    pub markers: Vec<BodyMarker>,
    /// Mean marker error, m.
    pub error: f32,
    /// Bit 0: tracked in this frame. `None` before 2.6, which has no flag.
    pub params: Option<u16>,
}

/// A skeleton (since 2.1).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Skeleton {
    /// Id.
    pub id: i32,
    /// Bones.
    pub bones: Vec<RigidBody>,
}

/// A labeled marker (since 2.3), or a marker of an asset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LabeledMarker {
    /// High 16 bits: asset, low 16 bits: member.
    pub id: i32,
    /// Position, m.
    pub position: Vec3,
    /// Diameter, m.
    pub size: f32,
    /// Flags (since 2.6); bit 0: occluded, bit 4: unlabeled.
    pub params: u16,
    /// Mean residual, m per ray (since 3.0).
    pub residual: f32,
}

/// An asset (since 4.1).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Asset {
    /// Id.
    pub id: i32,
    /// Its bodies.
    pub bodies: Vec<RigidBody>,
    /// Its markers.
    pub markers: Vec<LabeledMarker>,
}

/// Samples of a force plate (since 2.9) or a device (since 2.11).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChannelData {
    /// Id.
    pub id: i32,
    /// Samples of each channel.
    pub channels: Vec<Vec<f32>>,
}

/// What stands after the sections.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Suffix {
    /// Software latency, s (before 3.0).
    pub latency: f32,
    /// hours << 24 | minutes << 16 | seconds << 8 | frames.
    pub timecode: u32,
    /// Sub-frame of the timecode.
    pub timecode_sub: u32,
    /// Seconds since the software was started (single precision before 2.7).
    pub timestamp: f64,
    /// Camera mid-exposure, server ticks, 0 when not known (since 3.0).
    pub mid_exposure: u64,
    /// Camera data received, server ticks (since 3.0).
    pub received: u64,
    /// Transmission, server ticks (since 3.0).
    pub transmitted: u64,
    /// Precision timestamp, whole seconds (since 4.1).
    pub precision_seconds: u32,
    /// Precision timestamp, fraction (since 4.1).
    pub precision_fraction: u32,
    /// Bit 0: recording; bit 1: the set of tracked models has changed.
    pub params: u16,
}

/// Something odd about a frame that could be read all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fault {
    /// The announced payload size is not that of the datagram.
    Length {
        /// Announced.
        declared: usize,
        /// Present.
        found: usize,
    },
    /// A section's items ended before its announced size.
    SectionEnd {
        /// The section.
        section: &'static str,
        /// Bytes left in it.
        unread: usize,
    },
    /// Bytes that the version should not have, before the final six.
    Extra(usize),
}

/// One frame of data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Frame number; jumps back when a take loops or the server restarts.
    pub number: i32,
    /// Marker sets.
    pub marker_sets: Vec<MarkerSet>,
    /// Unlabeled markers, m.
    pub other_markers: Vec<Vec3>,
    /// Rigid bodies.
    pub rigid_bodies: Vec<RigidBody>,
    /// Skeletons (since 2.1).
    pub skeletons: Vec<Skeleton>,
    /// Assets (since 4.1).
    pub assets: Vec<Asset>,
    /// Labeled markers (since 2.3).
    pub labeled_markers: Vec<LabeledMarker>,
    /// Force plates (since 2.9).
    pub force_plates: Vec<ChannelData>,
    /// Devices (since 2.11).
    pub devices: Vec<ChannelData>,
    /// Times and flags.
    pub suffix: Suffix,
    /// What was odd about it; ignored when writing.
    pub faults: Vec<Fault>,
}

impl Frame {
    /// Whether the set of tracked models has changed, so that definitions must be asked for again.
    pub const fn models_changed(&self) -> bool {
        self.suffix.params & 2 != 0
    }
}
