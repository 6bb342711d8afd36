//! The server's side of a conversation: a fake Motive, for tests and demonstrations.

use super::message::datagram;
use super::{
    Clock, ConnectOptions, Definition, Frame, MarkerDefinition, MessageId, NatNetError, R, Response, RigidBody,
    RigidBodyDefinition, Sender, ServerInfo, UpAxis, Vec3, Version, W, command, model, split,
};
use monro_geometry::{Rigid, Tool, Tracker};
use std::collections::BTreeMap;

/// How a fake Motive behaves.
#[derive(Debug, Clone)]
pub struct ServerOptions {
    /// Bitstream version.
    pub version: Version,
    /// Names of its rigid bodies; their streaming ids count from 1.
    pub bodies: Vec<String>,
    /// Ticks per second of its clock.
    pub frequency: u64,
    /// Port it sends data to.
    pub data_port: u16,
    /// Whether it says that it sends by multicast.
    pub multicast: bool,
    /// Up-axis of the stream.
    pub up: UpAxis,
    /// Frames per second, as told when asked.
    pub rate: f32,
}

/// Markers of each body, m in its frame, until it is defined anew.
const MARKERS: [Vec3; 4] = [[0.03, 0.0, 0.0], [-0.03, 0.01, 0.0], [0.0, -0.02, 0.03], [0.0, 0.01, -0.03]];

/// A fake Motive.
#[derive(Debug)]
pub struct Server {
    options: ServerOptions,
    version: Version,
    number: i32,
    models_changed: bool,
    /// Of bodies that were defined anew.
    markers: BTreeMap<String, Vec<Vec3>>,
}

/// One body of a frame to be sent: its pose (or `None` when lost) and mean marker error, mm.
pub type BodyPose = (Option<Rigid<Tracker, Tool>>, f64);

impl Server {
    /// A server that has sent nothing yet.
    pub const fn new(options: ServerOptions) -> Self {
        Self { version: options.version, options, number: 0, models_changed: false, markers: BTreeMap::new() }
    }

    /// The version in which it sends now (a unicast client of 4.0 or later may have asked for an older one).
    pub const fn version(&self) -> Version {
        self.version
    }

    /// Who it says it is.
    pub fn info(&self) -> ServerInfo {
        let v = self.version;
        let sender = Sender { name: "Motive".to_owned(), application: [3, 1, 0, 0], natnet: [v.major, v.minor, 0, 0] };
        let o = &self.options;
        let group = super::MULTICAST_GROUP;
        let clock = Clock { frequency: o.frequency, data_port: o.data_port, multicast: o.multicast, group };
        ServerInfo { sender, clock: v.since(3, 0).then_some(clock) }
    }

    /// What it streams.
    pub fn definitions(&self) -> Vec<Definition> {
        let bodies = self.options.bodies.iter().zip(1..).map(|(name, id)| {
            Definition::RigidBody(RigidBodyDefinition {
                name: name.clone(),
                id,
                parent: -1,
                rotation_xyzw: [0.0, 0.0, 0.0, 1.0],
                markers: self.markers_of(name),
                ..RigidBodyDefinition::default()
            })
        });
        bodies.collect()
    }

    fn markers_of(&self, body: &str) -> Vec<MarkerDefinition> {
        let offsets = self.markers.get(body).map_or(&MARKERS[..], Vec::as_slice);
        offsets.iter().map(|&offset| MarkerDefinition { offset, ..MarkerDefinition::default() }).collect()
    }

    /// Defines a body anew with these markers (m, in its frame), as some servers do: no frame says so.
    pub fn redefine(&mut self, body: &str, markers: &[Vec3]) {
        self.markers.insert(body.to_owned(), markers.to_vec());
    }

    /// Renames the bodies, as when assets are made anew; the next frame says that the models have changed.
    pub fn rename(&mut self, bodies: Vec<String>) {
        self.options.bodies = bodies;
        self.models_changed = true;
    }

    /// Takes a client's datagram at `now` (s on the server's clock) and gives the answer, if it wants one.
    ///
    /// # Errors
    /// When the datagram cannot be read.
    pub fn receive(&mut self, bytes: &[u8], now: f64) -> Result<Option<Vec<u8>>, NatNetError> {
        let (header, payload) = split(bytes)?;
        Ok(match header.id {
            MessageId::Connect | MessageId::Discovery => {
                self.lower(ConnectOptions::decode(payload).bitstream);
                Some(self.info().encode())
            }
            MessageId::RequestModelDefinition => {
                self.models_changed = false;
                Some(model::encode(&self.definitions(), self.version))
            }
            MessageId::EchoRequest if self.version.since(3, 0) => Some(self.echo(payload, now)?),
            MessageId::Request => Some(self.answer(payload)),
            _ => None,
        })
    }

    /// Obeys a wish for an older bitstream where a real server would: unicast, 4.0 or later.
    fn lower(&mut self, wanted: Option<Version>) -> bool {
        let native = self.options.version;
        let may = !self.options.multicast && native.since(4, 0);
        let Some(v) = wanted.filter(|&v| may && v <= native && v.since(3, 0)) else { return false };
        self.version = v;
        true
    }

    fn ticks(&self, seconds: f64) -> u64 {
        (seconds * self.options.frequency as f64) as u64
    }

    fn echo(&self, payload: &[u8], now: f64) -> Result<Vec<u8>, NatNetError> {
        let stamp = R::new(payload).u64("client stamp");
        let named = |source| NatNetError::Read { message: "echo", version: self.version, source };
        let mut w = W::new();
        w.u64(stamp.map_err(named)?);
        w.u64(self.ticks(now));
        Ok(datagram(MessageId::EchoResponse, &w.0))
    }

    fn answer(&mut self, payload: &[u8]) -> Vec<u8> {
        let end = payload.iter().position(|&b| b == 0).unwrap_or(payload.len());
        let text = String::from_utf8_lossy(&payload[..end]).into_owned();
        let reply = match text.as_str() {
            "UnitsToMillimeters" => Response::Float(1000.0),
            "FrameRate" => Response::Float(self.options.rate),
            "CurrentMode" => Response::Integer(0),
            "Bitstream" => Response::Text(format!("Bitstream,{}", self.version)),
            other => match command::bitstream_of(other) {
                Some(v) => Response::Status(i32::from(!self.lower(Some(v)))),
                None => return datagram(MessageId::Unrecognized, &[]),
            },
        };
        reply.encode()
    }

    /// The next frame: the bodies in the order of their ids, exposed at `exposed` and sent at `now` (s on the
    /// server's clock, both).
    pub fn frame(&mut self, poses: &[BodyPose], exposed: f64, now: f64) -> Vec<u8> {
        let up = self.options.up;
        let bodies =
            poses.iter().zip(1..).map(|((pose, error), id)| RigidBody::from_pose(id, pose.as_ref(), *error, up));
        let mut frame = Frame { number: self.number, rigid_bodies: bodies.collect(), ..Frame::default() };
        frame.suffix.latency = (now - exposed) as f32;
        frame.suffix.timestamp = exposed;
        frame.suffix.mid_exposure = self.ticks(exposed).max(1);
        frame.suffix.received = self.ticks(0.5 * (exposed + now));
        frame.suffix.transmitted = self.ticks(now);
        frame.suffix.params = if self.models_changed { 2 } else { 0 };
        self.number = self.number.wrapping_add(1);
        frame.encode(self.version)
    }
}
