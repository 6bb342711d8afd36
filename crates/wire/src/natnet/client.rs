//! The client's side of a conversation, without sockets or a clock of its own.

use super::message::datagram;
use super::{
    ConnectOptions, Definition, Frame, MessageId, NatNetError, Pending, R, Response, RigidBody, Sender, ServerInfo,
    UpAxis, Version, W, command, definitions, split,
};
use crate::TimedPose;
use std::collections::BTreeMap;

/// How a client talks and reads.
#[derive(Debug, Clone, Default)]
pub struct ClientOptions {
    /// Reads frames with this version whatever the server says, also before it has said anything.
    pub force_version: Option<Version>,
    /// Motive's up-axis setting.
    pub up: UpAxis,
    /// Asks a server of 4.0 or later for this bitstream version (unicast only).
    pub bitstream: Option<Version>,
}

/// One clock question and its answer, for the estimate of the clocks' offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoExchange {
    /// When the question left, s on our clock.
    pub sent: f64,
    /// When the server answered, s on its clock.
    pub server: f64,
    /// When the answer came, s on our clock.
    pub received: f64,
}

/// What a datagram told.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The server introduced itself, or changed.
    Server(ServerInfo),
    /// What it streams.
    Models(Vec<Definition>),
    /// A frame, and the poses of its rigid bodies.
    Frame(Box<Frame>, Vec<TimedPose>),
    /// A clock exchange.
    Echo(EchoExchange),
    /// An answer to a command.
    Response(Response),
    /// A text for people.
    Text(String),
    /// The server dropped us; CONNECT is being sent again.
    Dropped,
}

/// What has been received so far.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames read.
    pub frames: u64,
    /// Frame numbers skipped.
    pub missed: u64,
    /// Times that the frame number jumped back for good (loop, new take, restart).
    pub restarts: u64,
    /// Datagrams refused.
    pub malformed: u64,
    /// The last reason.
    pub last_error: Option<NatNetError>,
    /// Frames read with oddities (size mismatches and the like).
    pub odd: u64,
}

/// A NatNet client.
#[derive(Debug)]
pub struct Client {
    options: ClientOptions,
    pub(super) server: Option<ServerInfo>,
    pub(super) names: BTreeMap<i32, String>,
    models_known: bool,
    /// Whether the server is to introduce itself again: it may be another one.
    ask_again: bool,
    pending: Option<Pending>,
    pub(super) counters: Counters,
    last_number: Option<i32>,
    /// When the last frame was exposed, ticks of the server's clock; 0 where that is not told.
    last_exposed: u64,
    /// Frames in a row that were older than one before them.
    late: u32,
    /// The last frame that was a new one, as far as it tells repeats: number, timestamp, exposure and bodies.
    last: Option<(i32, f64, u64, Vec<RigidBody>)>,
    last_params: u16,
    pub(super) seen: BTreeMap<i32, bool>,
    pub(super) times: Times,
}

/// When things were last done, s on our clock.
#[derive(Debug, Default)]
pub(super) struct Times {
    pub(super) start: Option<f64>,
    connect: Option<f64>,
    keep_alive: Option<f64>,
    models: Option<f64>,
    echo: Option<f64>,
    echoes: u32,
    pub(super) frame: Option<f64>,
    /// The last frame that did not say the same as the one before.
    pub(super) fresh: Option<f64>,
    /// When the last datagram came that could not be read.
    pub(super) malformed: Option<f64>,
    pub(super) server: Option<f64>,
}

/// A stream without frames for so long may have a new server, s.
const SILENT: f64 = 1.0;

/// A frame may be so many numbers behind the newest for coming late, and so many in a row: further back, or more of them, and
/// the numbers have begun anew.
const LATE: i64 = 100;
const MOST_LATE: u32 = 4;

/// Between two questions for the names of the bodies, s: a datagram may be lost, and without names there are no tools.
const MODELS: f64 = 0.25;

/// Between two questions when they are known, s: not every server says when a body was defined anew, and that voids what it was
/// calibrated for.
const MODELS_AGAIN: f64 = 2.0;

fn due(last: &mut Option<f64>, now: f64, interval: f64) -> bool {
    let is_due = last.is_none_or(|t| now - t >= interval);
    if is_due {
        *last = Some(now);
    }
    is_due
}

impl Client {
    /// A client that has not said anything yet.
    pub fn new(options: ClientOptions) -> Self {
        Self {
            options,
            server: None,
            names: BTreeMap::new(),
            models_known: false,
            ask_again: false,
            pending: None,
            counters: Counters::default(),
            last_number: None,
            last_exposed: 0,
            last: None,
            late: 0,
            last_params: 0,
            seen: BTreeMap::new(),
            times: Times::default(),
        }
    }

    /// The server, once it has answered.
    pub const fn server(&self) -> Option<&ServerInfo> {
        self.server.as_ref()
    }

    /// What has been received so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Names of the rigid bodies by streaming id.
    pub const fn names(&self) -> &BTreeMap<i32, String> {
        &self.names
    }

    /// The version with which frames are read.
    pub fn version(&self) -> Option<Version> {
        self.options.force_version.or_else(|| Some(self.server.as_ref()?.sender.version()))
    }

    /// The datagrams to send to the server's command port at `now` (s). Call it some ten times a second.
    pub fn poll(&mut self, now: f64) -> Vec<Vec<u8>> {
        self.times.start.get_or_insert(now);
        let mut out = Vec::new();
        // A server that was restarted does not know us: one that has fallen silent is asked anew.
        let silent = self.times.frame.is_some_and(|t| now - t >= SILENT);
        if (self.server.is_none() || self.ask_again || silent) && due(&mut self.times.connect, now, 1.0) {
            out.push(self.connect());
        }
        if self.server.is_none() {
            return out;
        }
        if due(&mut self.times.keep_alive, now, 1.0) {
            out.push(datagram(MessageId::KeepAlive, &[]));
        }
        let interval = if self.models_known { MODELS_AGAIN } else { MODELS };
        if due(&mut self.times.models, now, interval) {
            out.push(datagram(MessageId::RequestModelDefinition, &[]));
        }
        let has_clock = self.server.as_ref().is_some_and(|s| s.clock.is_some());
        let interval = if self.times.echoes < 8 { 0.25 } else { 1.0 };
        if has_clock && due(&mut self.times.echo, now, interval) {
            self.times.echoes = self.times.echoes.saturating_add(1);
            let mut w = W::new();
            w.u64((now * 1e9) as u64);
            out.push(datagram(MessageId::EchoRequest, &w.0));
        }
        out
    }

    fn connect(&self) -> Vec<u8> {
        let v = self.options.bitstream.unwrap_or(Version::NEWEST);
        let sender = Sender { name: "Monro".to_owned(), application: [0, 1, 0, 0], natnet: [v.major, v.minor, 0, 0] };
        ConnectOptions { sender: Some(sender), bitstream: self.options.bitstream }.encode(MessageId::Connect)
    }

    /// Asks the server everything anew: it was restarted, and may now stream other things in another version.
    pub fn restart(&mut self) {
        (self.ask_again, self.models_known) = (true, false);
        self.names.clear();
        self.seen.clear();
        let Times { start, frame, fresh, server, .. } = self.times;
        self.times = Times { start, frame, fresh, server, ..Times::default() };
    }

    /// The datagram of a text command. One at a time: its answer is read by what was asked.
    pub fn request(&mut self, text: &str) -> Vec<u8> {
        let (bytes, pending) = command::request(text);
        self.pending = Some(pending);
        bytes
    }

    /// The datagram that says good-bye.
    pub fn disconnect(&self) -> Vec<u8> {
        datagram(MessageId::Disconnect, &[])
    }

    /// Takes a datagram that arrived at `now` (s), on either socket. `None` for what concerns nobody.
    ///
    /// # Errors
    /// Why it was refused; counted too. The conversation goes on.
    pub fn receive(&mut self, bytes: &[u8], now: f64) -> Result<Option<Event>, NatNetError> {
        let result = self.take(bytes, now);
        if let Err(e) = &result {
            self.counters.malformed += 1;
            self.counters.last_error = Some(e.clone());
            self.times.malformed = Some(now);
        }
        result
    }

    fn take(&mut self, bytes: &[u8], now: f64) -> Result<Option<Event>, NatNetError> {
        let (header, payload) = split(bytes)?;
        let declared = usize::from(header.declared);
        Ok(match header.id {
            MessageId::ServerInfo => Some(self.take_server(ServerInfo::decode(payload)?, now)),
            MessageId::ModelDefinition => Some(self.take_models(payload)?),
            MessageId::Frame => Some(self.take_frame(payload, declared, now)?),
            MessageId::EchoResponse => self.take_echo(payload, now)?.map(Event::Echo),
            MessageId::Response => {
                self.pending.take().map(|pending| Event::Response(Response::decode(payload, pending)))
            }
            MessageId::Unrecognized => self.pending.take().map(|_| Event::Response(Response::Status(-1))),
            MessageId::Text => {
                let end = payload.iter().position(|&b| b == 0).unwrap_or(payload.len());
                Some(Event::Text(String::from_utf8_lossy(&payload[..end]).into_owned()))
            }
            MessageId::TimedOut => {
                // Its frames may go on, by multicast, and are read as before.
                self.ask_again = true;
                Some(Event::Dropped)
            }
            _ => None,
        })
    }

    fn take_server(&mut self, info: ServerInfo, now: f64) -> Event {
        if self.server.as_ref() != Some(&info) {
            self.models_known = false;
            self.times.echoes = 0;
        }
        self.ask_again = false;
        // Frames that came before this answer were no fault of the stream.
        self.counters.last_error.take_if(|e| *e == NatNetError::NoVersion);
        self.times.server.get_or_insert(now);
        self.server = Some(info.clone());
        Event::Server(info)
    }

    fn take_models(&mut self, payload: &[u8]) -> Result<Event, NatNetError> {
        let models = definitions(payload, self.version().ok_or(NatNetError::NoVersion)?)?;
        let bodies = models.iter().filter_map(|d| match d {
            Definition::RigidBody(b) => Some((b.id, b.name.clone())),
            _ => None,
        });
        self.names = bodies.collect();
        self.models_known = true;
        Ok(Event::Models(models))
    }

    fn take_frame(&mut self, payload: &[u8], declared: usize, now: f64) -> Result<Event, NatNetError> {
        let version = self.version().ok_or(NatNetError::NoVersion)?;
        let mut frame = Frame::decode(payload, version)?;
        if declared != payload.len() {
            frame.faults.push(super::Fault::Length { declared, found: payload.len() });
        }
        self.counters.frames += 1;
        self.counters.odd += u64::from(!frame.faults.is_empty());
        self.times.frame = Some(now);
        // What is late, or said before, says nothing of now: neither of places nor of what is streamed.
        let repeats = self.is_repeated(&frame);
        if !repeats {
            self.times.fresh = Some(now);
        }
        if self.is_late(&frame) || repeats {
            return Ok(Event::Frame(Box::new(frame), Vec::new()));
        }
        self.follow(&frame);
        let frequency = self.server.as_ref().and_then(|s| s.clock).map(|c| c.frequency);
        let name = |id: i32| self.names.get(&id).cloned().unwrap_or_else(|| format!("#{id}"));
        let poses = frame.poses(self.options.up, frequency, now, name);
        Ok(Event::Frame(Box::new(frame), poses))
    }

    /// Whether a frame is older than one that was here already (disorder on the way). Where frame numbers have gone back for
    /// good (a loop, another take, a restart), ids may stand for other bodies: nobody has a name until they are told again. One
    /// that was exposed after the last is not late, whatever its number (a loop; a server that does not count).
    fn is_late(&mut self, frame: &Frame) -> bool {
        let (number, exposed) = (frame.number, frame.suffix.mid_exposure);
        let step = self.last_number.map_or(1, |last| i64::from(number) - i64::from(last));
        let is_newer = self.last_exposed > 0 && exposed > self.last_exposed;
        self.late = if step > 0 || is_newer { 0 } else { self.late + 1 };
        if !is_newer && (-LATE..=0).contains(&step) && self.late <= MOST_LATE {
            return true;
        }
        if step > 0 {
            self.counters.missed += (step - 1) as u64;
        } else if step < 0 || !is_newer {
            self.counters.restarts += 1;
            self.names.clear();
            (self.models_known, self.times.models, self.late) = (false, None, 0);
        }
        (self.last_number, self.last_exposed) = (Some(number), exposed);
        false
    }

    /// Whether a frame says what the last one said, of one and the same moment, to the last bit: measured places tremble. A
    /// server that counts neither its frames nor the time, and sends what does not move, is not told from that.
    fn is_repeated(&mut self, frame: &Frame) -> bool {
        let (time, exposed) = (frame.suffix.timestamp, frame.suffix.mid_exposure);
        let dated = time > 0.0 || exposed > 0;
        let same = |(number, t, e, bodies): &(i32, f64, u64, Vec<RigidBody>)| {
            (*number == frame.number || dated) && (*t, *e) == (time, exposed) && *bodies == frame.rigid_bodies
        };
        if self.last.as_ref().is_some_and(same) {
            return true;
        }
        self.last = Some((frame.number, time, exposed, frame.rigid_bodies.clone()));
        false
    }

    /// What the newest frame says of the stream.
    fn follow(&mut self, frame: &Frame) {
        self.seen = frame.rigid_bodies.iter().map(|b| (b.id, b.is_tracked())).collect();
        // Bits 2 and 3: the bitstream may have changed. Their meaning differs between sources, so a change of them, not
        // their state, makes us ask again.
        let changed = (frame.suffix.params ^ self.last_params) & 0x0c != 0;
        // Bit 1, which some servers go on setting: its beginning counts.
        let renamed = frame.models_changed() && self.last_params & 2 == 0;
        self.last_params = frame.suffix.params;
        if renamed {
            // Ids may stand for other bodies now: until the new names are there, nobody has one.
            self.names.clear();
            (self.models_known, self.times.models) = (false, None);
        }
        if changed {
            self.server = None;
        }
    }

    fn take_echo(&self, payload: &[u8], now: f64) -> Result<Option<EchoExchange>, NatNetError> {
        let Some(clock) = self.server.as_ref().and_then(|s| s.clock).filter(|c| c.frequency > 0) else {
            return Ok(None);
        };
        let version = self.version().unwrap_or(Version::NEWEST);
        let named = |source| NatNetError::Read { message: "echo", version, source };
        let mut r = R::new(payload);
        let stamp = r.u64("client stamp").map_err(named)?;
        let ticks = r.u64("server ticks").map_err(named)?;
        let (sent, server) = (stamp as f64 / 1e9, ticks as f64 / clock.frequency as f64);
        // An answer to a question that we cannot have asked is not ours.
        Ok((sent <= now).then_some(EchoExchange { sent, server, received: now }))
    }
}
