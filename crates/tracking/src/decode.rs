//! From the bytes of a tracker to frames of poses. A live source and its recording go through the same decoder with the same
//! arrival times, so both give the same poses bit for bit.

use crate::Batch;
use crate::late::{Late, Stamps};
use crate::told::Told;
use monro_guidance::clock::{ClockEstimate, Exchange, Offset, age};
use monro_wire::TimedPose;
use monro_wire::natnet::{Client, ClientOptions, Definition, Event, RigidBodyDefinition, ServerInfo};
use monro_wire::openigtlink::{Content, IgtlError, Message, Parser, StatusCode, poses};
use std::collections::{BTreeMap, VecDeque};

/// Frames are held back until their tools have names, but no longer than this, s.
const PATIENCE_FOR_NAMES: f64 = 1.0;
/// Exchanges with the server's clock that are looked back on, s.
const CLOCK_WINDOW: f64 = 60.0;

/// What a datagram of NatNet brought.
#[derive(Debug)]
pub(crate) enum Taken {
    /// The server introduced itself.
    Server(ServerInfo),
    /// Poses.
    Frame(Batch),
    /// Nothing to hand on.
    Nothing,
}

/// Reads datagrams of NatNet.
#[derive(Debug)]
pub(crate) struct NatNetDecoder {
    pub(crate) client: Client,
    pub(crate) estimate: ClockEstimate,
    first_frame: Option<f64>,
    pub(crate) late: Late,
    /// Of the last frames when they arrived, s.
    pub(crate) age: f64,
    /// What was said of bodies and not handed on yet.
    bodies: Vec<RigidBodyDefinition>,
    last: Option<Last>,
}

/// The last frame: when it was exposed and stamped, each on a clock of the server, and when it arrived on ours, s.
#[derive(Debug, Clone, Copy)]
struct Last {
    exposed: Option<f64>,
    stamped: Option<f64>,
    arrival: f64,
}

/// A clock that goes back by more than this, or exposures that far in the future, belong to a server that was restarted, s.
const BREAK: f64 = 0.25;
/// No server takes as long from exposure to sending, s: its two times are not of one clock.
const MOST_TOLD: f64 = 10.0;
/// What a frame counts in the mean of the last ones' ages.
const SHARE: f64 = 0.05;
/// After a silence of this length it may have been restarted too, s.
const SILENCE: f64 = 1.0;

impl NatNetDecoder {
    pub(crate) fn new(options: ClientOptions, stamps: Stamps) -> Self {
        let (client, estimate) = (Client::new(options), ClockEstimate::new(CLOCK_WINDOW));
        let late = Late::new(stamps);
        Self { client, estimate, first_frame: None, late, age: 0.0, bodies: Vec::new(), last: None }
    }

    /// Whether a frame may come from another server than the last one: after a silence, or because the clock of exposures has
    /// gone back, or ahead of the arrivals (one that was held up on its way has done neither). Where the clock has, or after a
    /// silence no clock goes on, nothing is known of it any more.
    fn is_restarted(&mut self, now: Last) -> bool {
        let Some(last) = self.last.replace(now) else { return false };
        let passed = now.arrival - last.arrival;
        let goes_on = |now: Option<f64>, before: Option<f64>, late: f64| {
            Some((-BREAK..=passed + late + BREAK).contains(&(now? - before?)))
        };
        let exposed_late = |o: Offset| last.exposed.map_or(0.0, |e| last.arrival - o.to_ours(e)).max(0.0);
        let exposures = goes_on(now.exposed, last.exposed, self.estimate.offset().map_or(0.0, exposed_late));
        let clock_broke = exposures == Some(false);
        let silent = passed > SILENCE;
        if clock_broke || (silent && exposures.or(goes_on(now.stamped, last.stamped, 0.0)) != Some(true)) {
            self.estimate.forget();
            self.late.forget();
        }
        clock_broke || silent
    }

    /// Takes a datagram that arrived at `arrival`, s. One that cannot be read is counted by the client.
    pub(crate) fn take(&mut self, arrival: f64, bytes: &[u8]) -> Taken {
        match self.client.receive(bytes, arrival) {
            Ok(Some(Event::Server(info))) => return Taken::Server(info),
            Ok(Some(Event::Models(all))) => {
                let body = |d| if let Definition::RigidBody(b) = d { Some(b) } else { None };
                self.bodies = all.into_iter().filter_map(body).collect();
            }
            Ok(Some(Event::Echo(e))) => {
                self.estimate.push(Exchange { sent: e.sent, other: e.server, received: e.received });
            }
            Ok(Some(Event::Frame(frame, poses))) => {
                let frequency = self.client.server().and_then(|s| s.clock).map(|c| c.frequency);
                let told = frame.system_latency(frequency).filter(|s| (0.0..MOST_TOLD).contains(s));
                return self.frame(arrival, (frame.suffix.timestamp, told.unwrap_or(0.0)), poses);
            }
            _ => {}
        }
        Taken::Nothing
    }

    /// `told`: how long the server says that it took from exposure to sending, s.
    fn frame(&mut self, arrival: f64, (timestamp, told): (f64, f64), mut poses: Vec<TimedPose>) -> Taken {
        let exposed = poses.first().and_then(|p| p.source_time);
        let stamped = Some(timestamp).filter(|s| *s > 0.0);
        if self.is_restarted(Last { exposed, stamped, arrival }) {
            self.client.restart();
            self.first_frame = None;
            // Its bodies may have got other numbers: these poses might bear wrong names.
            return Taken::Nothing;
        }
        let clock = self.estimate.offset();
        if !poses.is_empty() {
            // Where there is no clock of the cameras, that of the server's frames will do. What they have fallen behind since they
            // were sent comes to what passed before.
            let stamp = exposed.filter(|s| *s > 0.0).or(stamped);
            let lag = self.late.take(stamp.map(|s| s + told), arrival) + told;
            poses.iter_mut().for_each(|p| p.lag = lag);
            self.age += SHARE * (age(arrival, (arrival, lag), exposed, clock.as_ref()) - self.age);
        }
        let first = *self.first_frame.get_or_insert(arrival);
        // Names come a moment after the first frames; a server that never tells them is listened to all the same.
        if self.client.names().is_empty() && arrival - first <= PATIENCE_FOR_NAMES {
            return Taken::Nothing;
        }
        Taken::Frame(Batch { poses, clock, bodies: std::mem::take(&mut self.bodies) })
    }
}

/// Reads a stream of OpenIGTLink.
#[derive(Debug, Default)]
pub(crate) struct IgtlDecoder {
    parser: Parser,
    stamps: Stamps,
    ready: VecDeque<Batch>,
    /// Messages of each type and device.
    pub(crate) devices: BTreeMap<String, u64>,
    /// When each tool, and when anything, was last told of, s.
    pub(crate) tools: BTreeMap<String, Told>,
    pub(crate) last: Option<f64>,
    /// Messages that could not be read, and why the last could not.
    pub(crate) dropped: u64,
    pub(crate) fault: Option<String>,
    /// What each device last said of itself, where that was an error.
    pub(crate) errors: BTreeMap<String, String>,
}

/// Devices and tools that are remembered at most; a server that sends ever new names is misconfigured.
const MOST_NAMES: usize = 256;
/// Where there are as many, tools that have not come for so long make room for others, s.
const FORGOTTEN_S: f64 = 1.0;
/// Longest name of a tool, bytes.
const LONGEST_NAME: usize = 256;

impl IgtlDecoder {
    pub(crate) fn new(stamps: Stamps) -> Self {
        Self { stamps, ..Self::default() }
    }

    /// Notes what is told of a tool; whether there is room for it. Where a server sends ever new names, those that have not come
    /// for a second make room.
    fn note(&mut self, pose: &mut TimedPose) -> bool {
        let now = pose.arrival_time;
        if self.tools.len() >= MOST_NAMES && !self.tools.contains_key(&pose.name) {
            self.tools.retain(|_, told| now - told.at < FORGOTTEN_S);
            if self.tools.len() >= MOST_NAMES {
                return false;
            }
        }
        self.tools.entry(pose.name.clone()).or_insert_with(|| Told::new(now, self.stamps)).take(pose);
        true
    }

    /// Notes what a device says of itself.
    fn note_status(&mut self, message: &Message) {
        let Content::Status(status) = &message.content else { return };
        if status.code == StatusCode::Ok {
            self.errors.remove(&message.device);
        } else if self.errors.len() < MOST_NAMES || self.errors.contains_key(&message.device) {
            let said = [&status.name, &status.message].map(|t| t.chars().take(LONGEST_NAME).collect::<String>());
            let words = format!("'{}' reports {:?} ({}: {})", message.device, status.code, said[0], said[1]);
            self.errors.insert(message.device.clone(), words);
        }
    }

    /// A new connection begins: what is unfinished of the last one is forgotten, but not how late its stamps came. Another
    /// server's go on elsewhere, which is found as a clock set anew.
    pub(crate) fn begin(&mut self) {
        self.parser = Parser::default();
        self.errors.clear();
    }

    /// Takes a piece of the stream that arrived at `arrival`, s.
    pub(crate) fn take(&mut self, arrival: f64, bytes: &[u8]) -> Result<(), IgtlError> {
        self.parser.push(bytes);
        while let Some(message) = self.parser.next_message() {
            match message {
                Ok(m) => {
                    let device = format!("{} {}", m.content.type_name(), m.device);
                    if self.devices.len() < MOST_NAMES || self.devices.contains_key(&device) {
                        *self.devices.entry(device).or_default() += 1;
                    }
                    self.last = Some(arrival);
                    self.note_status(&m);
                    let mut told = poses(&m, arrival);
                    if told.iter().any(|p| p.name.len() > LONGEST_NAME) {
                        self.dropped += 1;
                        self.fault = Some(format!("a tool's name is longer than {LONGEST_NAME} bytes"));
                        told.retain(|p| p.name.len() <= LONGEST_NAME);
                    }
                    let before = told.len();
                    told.retain_mut(|pose| self.note(pose));
                    if told.len() < before {
                        self.dropped += 1;
                        self.fault =
                            Some(format!("more than {MOST_NAMES} tools are sent: those of new names are left out"));
                    }
                    self.add(told);
                }
                Err(error) if self.parser.is_broken() => return Err(error),
                Err(error) => {
                    self.dropped += 1;
                    self.fault = Some(error.to_string());
                }
            }
        }
        Ok(())
    }

    /// Messages of one moment about different tools are one frame.
    fn add(&mut self, poses: Vec<TimedPose>) {
        let Some(first) = poses.first() else { return };
        let same = |b: &&mut Batch| {
            let time = b.poses.first().and_then(|p| p.source_time);
            time.is_some() && time == first.source_time && !b.poses.iter().any(|p| p.name == first.name)
        };
        match self.ready.back_mut().filter(same) {
            Some(batch) => batch.poses.extend(poses),
            None => self.ready.push_back(Batch { poses, ..Batch::default() }),
        }
    }

    /// The next frame.
    pub(crate) fn next(&mut self) -> Option<Batch> {
        self.ready.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Rigid, Tool, Tracker};
    use monro_wire::natnet::{Server, ServerOptions, UpAxis, Version};
    use monro_wire::openigtlink::{Matrix34, Timestamp, ToolStatus};
    use monro_wire::{Missing, Quality};

    /// How late (s) what was measured at a time arrives: a queue that grows for ten seconds, to 0.8 s.
    fn queue(measured: f64) -> f64 {
        0.005 + 0.08 * (measured - 5.0).clamp(0.0, 10.0)
    }

    fn pose(x: f64) -> Rigid<Tracker, Tool> {
        Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], monro_geometry::Vector::new(x, 0.0, 0.0)).expect("pose")
    }

    /// Lags of the last pose, on the way and after another connection.
    fn lags_of_openigtlink(stamps: Stamps) -> [f64; 2] {
        let mut decoder = IgtlDecoder::new(stamps);
        let mut one = |i: u32, begin: bool| {
            let (measured, time) = (f64::from(i) / 60.0, Timestamp::from_seconds(1.7e9 + f64::from(i) / 60.0));
            let message = Message::transform("Catheter", time, i, Some(&pose(measured)), ToolStatus::Ok);
            if begin {
                decoder.begin();
            }
            decoder.take(measured + queue(measured), &message.encode().expect("message")).expect("stream");
            let lag = decoder.next().expect("a pose").poses[0].lag;
            (lag, decoder.tools["Catheter"].late.words("'Catheter'"))
        };
        let (late, words) = (0..1020).map(|i| one(i, false)).last().expect("poses");
        assert_eq!(words.is_some_and(|w| w.contains("0.80 s later")), stamps == Stamps::Heeded);
        [late, one(1020, true).0]
    }

    /// A server that fell behind was shown as live, 20 mm off at 25 mm/s.
    #[test]
    fn poses_of_an_openigtlink_server_that_fell_behind_were_as_young_as_their_arrival() {
        let [late, again] = lags_of_openigtlink(Stamps::Heeded);
        assert!((late - 0.8).abs() < 1e-3 && (again - 0.8).abs() < 1e-3, "{late}, {again}");
        assert_eq!(lags_of_openigtlink(Stamps::Ignored), [0.0, 0.0]);
    }

    #[test]
    fn a_tool_out_of_view_was_at_the_trackers_origin_where_that_is_how_it_is_sent() {
        let mut decoder = IgtlDecoder::new(Stamps::Heeded);
        let mut sent = |name: &str, pose: &Rigid<Tracker, Tool>| {
            let message = Message::v1(name, None, Content::Transform(Matrix34::from_rigid(pose)));
            decoder.take(0.0, &message.encode().expect("message")).expect("stream");
            decoder.next().expect("a pose").poses[0].quality
        };
        let tracked = Quality::Tracked { error: None };
        assert_eq!([&Rigid::IDENTITY, &pose(1.0)].map(|p| sent("Catheter", p)), [tracked, tracked]);
        assert_eq!(sent("Catheter", &Rigid::IDENTITY), Quality::Missing(Missing::NotTracked));
        assert_eq!(sent("Catheter", &pose(1e-3)), tracked);
        assert!((0..9).all(|_| sent("Reference", &Rigid::IDENTITY) == tracked), "one to which all poses are");
    }

    /// One that has no clock to be asked, and two that have.
    const VERSIONS: [&str; 3] = ["2.9", "3.0", "4.1"];

    /// Lags of so many frames of a server that answers no question of its clock; `took`: how long (s) after its exposure one is sent,
    /// and arrives.
    fn lags_of_natnet(version: &str, frames: u32, took: impl Fn(f64) -> [f64; 2]) -> Vec<f64> {
        let (version, bodies) = (Version::parse(version).expect("version"), vec!["Catheter".to_owned()]);
        let (frequency, data_port, multicast, up) = (1_000_000, 1511, false, UpAxis::Y);
        let options = ServerOptions { version, bodies, frequency, data_port, multicast, up, rate: 60.0 };
        let mut server = Server::new(options);
        let mut decoder = NatNetDecoder::new(ClientOptions::default(), Stamps::Heeded);
        decoder.take(0.0, &server.info().encode());
        let lag = |i: u32| {
            let measured = f64::from(i) / 60.0;
            let [sent, arrives] = took(measured);
            let bytes = server.frame(&[(Some(pose(measured)), 0.3)], measured, measured + sent);
            match decoder.take(measured + arrives, &bytes) {
                Taken::Frame(batch) => Some(batch.poses[0].lag),
                _ => None,
            }
        };
        (1..=frames).filter_map(lag).collect()
    }

    /// It was said in each frame, and poses of 150 ms were as young as their arrival.
    #[test]
    fn what_a_natnet_server_says_of_its_own_delay_was_not_counted_without_a_common_clock() {
        for version in VERSIONS {
            // It takes longer from 5 s on.
            let took = |measured: f64| if measured < 5.0 { 0.04 } else { 0.15 };
            let lags = lags_of_natnet(version, 599, |measured| [took(measured), took(measured) + 0.002]);
            let [before, after] = [lags[100], lags[lags.len() - 1]];
            assert!((before - 0.04).abs() < 1e-3 && (after - 0.15).abs() < 1e-3, "{version}: {before}, {after}");
        }
    }

    /// The channel was worked off for many seconds after such a flood, and the right tracker behind it was "silent".
    #[test]
    fn ever_new_names_take_no_room_from_a_tracker_that_comes_after_them() {
        let mut decoder = IgtlDecoder::new(Stamps::Heeded);
        let mut sent = |name: &str, at: f64| {
            let message = Message::v1(name, None, Content::Transform(Matrix34::from_rigid(&pose(at))));
            decoder.take(at, &message.encode().expect("message")).expect("stream");
            (decoder.next().map(|b| b.poses.len()), decoder.tools.len(), decoder.fault.is_some())
        };
        let flood: Vec<_> = (0..1000).map(|i| sent(&format!("T{i}"), 1.0 + f64::from(i) * 1e-4)).collect();
        assert!(flood.iter().all(|f| f.1 <= MOST_NAMES) && flood[999] == (None, MOST_NAMES, true), "{:?}", flood[999]);
        assert_eq!(sent("Catheter", 2.2).0, Some(1));
    }

    /// After a silence of a second all that was known of its clock was forgotten: what had waited was "live", three seconds old.
    #[test]
    fn frames_that_waited_while_the_link_was_out_were_as_young_as_their_arrival() {
        for version in VERSIONS {
            // Nothing comes from 8 s on for as long as it is held up, and is as late from then on.
            let held_up = |measured: f64| if measured < 8.0 { 0.002 } else { 3.0 };
            let lags = lags_of_natnet(version, 719, |measured| [0.0, held_up(measured)]);
            let last = lags[lags.len() - 1];
            assert!((last - 2.998).abs() < 2e-3, "{version}: {last}");
        }
    }

    /// Before 3.0 there is no clock to be asked, and a server may not answer.
    #[test]
    fn frames_of_a_natnet_server_without_a_clock_that_fell_behind_were_as_young_as_their_arrival() {
        for version in VERSIONS {
            let lags = lags_of_natnet(version, 1019, |measured| [0.0, queue(measured)]);
            let last = lags[lags.len() - 1];
            assert!((last - 0.8).abs() < 2e-3, "{version}: {last}");
        }
    }
}
