//! The contents of the message types, one idea a file.

mod command;
mod image;
mod points;
mod polydata;
mod status;
mod tracking;

pub use command::{Command, StreamRequest};
pub use image::{ByteOrder, Image, ImageAxes, ScalarType};
pub use points::{PointElement, Trajectory, TrajectoryKind};
pub use polydata::{Attribute, AttributeKind, Cells, PolyData};
pub use status::{Status, StatusCode, Text, TextEncoding};
pub use tracking::{InstrumentKind, Position, QuaternionElement, TrackingElement};
