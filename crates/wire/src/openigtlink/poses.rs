//! From messages to timed poses, with the tool status that PLUS and 3D Slicer put into the metadata.

use super::{Content, Message};
use crate::{Missing, TimedPose};
use monro_geometry::{Rigid, Tool, Tracker};

/// Tool status as PLUS spells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToolStatus {
    /// Tracked.
    Ok,
    /// Port or tool absent, invalid, time-out, unknown: no pose.
    Missing,
    /// Out of view or out of volume.
    OutOfVolume,
}

impl ToolStatus {
    /// From a metadata value: any case, with or without the older `TOOL_` prefix. Switch states count as tracked;
    /// anything not known counts as missing, for a pose must not be trusted on a word that we cannot read.
    pub fn parse(value: &str) -> Self {
        let upper = value.trim().to_ascii_uppercase();
        let word = upper.strip_prefix("TOOL_").unwrap_or(&upper);
        match word {
            "OK" => Self::Ok,
            _ if word.starts_with("SWITCH") => Self::Ok,
            "OUT_OF_VIEW" | "OUT_OF_VOLUME" => Self::OutOfVolume,
            _ => Self::Missing,
        }
    }

    /// The value that PLUS and Slicer understand.
    pub const fn value(self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::Missing => "MISSING",
            Self::OutOfVolume => "OUT_OF_VOLUME",
        }
    }

    const fn fault(self) -> Option<Missing> {
        match self {
            Self::Ok => None,
            Self::Missing => Some(Missing::NotTracked),
            Self::OutOfVolume => Some(Missing::OutOfVolume),
        }
    }
}

impl Message {
    /// A TRANSFORM with its status, as we send it: a lost tool keeps its name flowing with an identity that is marked
    /// as missing, never with its last pose.
    pub fn transform(
        device: impl Into<String>,
        time: Option<super::Timestamp>,
        id: u32,
        pose: Option<&Rigid<Tracker, Tool>>,
        status: ToolStatus,
    ) -> Self {
        let valid = pose.filter(|_| status == ToolStatus::Ok);
        let matrix = valid.map_or(super::Matrix34::IDENTITY, super::Matrix34::from_rigid);
        let status = if valid.is_none() && status == ToolStatus::Ok { ToolStatus::Missing } else { status };
        Self::v2(device, time, id, Content::Transform(matrix)).with("TransformStatus", status.value())
    }

    /// Status of the whole message: the metadata keys of PLUS and Slicer; `Ok` when there is none, as they assume.
    fn status(&self) -> ToolStatus {
        let named = self.meta("TransformStatus").or_else(|| self.meta("Status")).map(ToolStatus::parse);
        let valid = |text: &str| match text.trim() {
            text if text.eq_ignore_ascii_case("false") => false,
            text => text.parse() != Ok(0.0),
        };
        let number = self.meta("TransformValid").map(|v| if valid(v) { ToolStatus::Ok } else { ToolStatus::Missing });
        // Where the two disagree, the one that does not trust the pose wins.
        [named, number].into_iter().flatten().find(|s| *s != ToolStatus::Ok).unwrap_or(ToolStatus::Ok)
    }

    fn full_name(&self) -> &str {
        self.meta("IGTL_DEVICE_NAME").unwrap_or(&self.device)
    }
}

/// The poses of a TRANSFORM, POSITION, TDATA or QTDATA message, whose arrival was at `arrival` s on our clock. Other
/// messages have none.
pub fn poses(message: &Message, arrival: f64) -> Vec<TimedPose> {
    let time = message.time.map(super::Timestamp::seconds);
    let one = |name: &str, status: ToolStatus, turned: bool, rigid: Option<Rigid<Tracker, Tool>>| {
        let pose = match status.fault() {
            Some(missing) => Err(missing),
            None if !turned => Err(Missing::NoOrientation),
            None => rigid.map(|r| (r, None)).ok_or(Missing::NotRigid),
        };
        TimedPose::new(name, time, arrival, pose)
    };
    let element_status =
        |name: &str| message.meta(&format!("{name}Status")).map_or_else(|| message.status(), ToolStatus::parse);
    match &message.content {
        Content::Transform(m) => vec![one(message.full_name(), message.status(), true, m.to_rigid())],
        Content::Position(p) => {
            vec![one(message.full_name(), message.status(), p.quaternion_xyzw.is_some(), p.to_rigid())]
        }
        Content::TrackingData(list) => list
            .iter()
            .map(|e| one(&e.name, element_status(&e.name), e.kind.is_turned(), e.matrix.to_rigid()))
            .collect(),
        Content::QuaternionTrackingData(list) => {
            list.iter().map(|e| one(&e.name, element_status(&e.name), e.kind.is_turned(), e.to_rigid())).collect()
        }
        _ => Vec::new(),
    }
}
