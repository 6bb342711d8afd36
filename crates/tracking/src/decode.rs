//! From the bytes of a tracker to frames of poses. A live source and its recording go through the same decoder with the same
//! arrival times, so both give the same poses bit for bit.

use crate::Batch;
use monro_geometry::{Rigid, Tool, Tracker};
use monro_guidance::clock::{ClockEstimate, Exchange};
use monro_wire::natnet::{Client, ClientOptions, Event, ServerInfo};
use monro_wire::openigtlink::{IgtlError, Parser, poses};
use monro_wire::{Missing, Quality, TimedPose};
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
    /// Exposure of the last frame on the server's clock, and its arrival on ours, s.
    last: Option<(Option<f64>, f64)>,
}

/// A clock that goes back by more than this, or exposures that far in the future, belong to a server that was restarted, s.
const BREAK: f64 = 0.25;
/// After a silence of this length it may have been restarted too, s.
const SILENCE: f64 = 1.0;

impl NatNetDecoder {
    pub(crate) fn new(options: ClientOptions) -> Self {
        let (client, estimate) = (Client::new(options), ClockEstimate::new(CLOCK_WINDOW));
        Self { client, estimate, first_frame: None, last: None }
    }

    /// Whether a frame may come from another server than the last one: after a silence, or because the clock has gone back,
    /// or ahead of the arrivals (one that was held up on its way has done neither).
    fn is_restarted(&mut self, source: Option<f64>, arrival: f64) -> bool {
        let Some((before, then)) = self.last.replace((source, arrival)) else { return false };
        let clock_broke = source.zip(before).is_some_and(|(source, before)| {
            let late = self.estimate.offset().map_or(0.0, |o| then - o.to_ours(before)).max(0.0);
            source < before - BREAK || source - before > arrival - then + late + BREAK
        });
        clock_broke || arrival - then > SILENCE
    }

    /// Takes a datagram that arrived at `arrival`, s. One that cannot be read is counted by the client.
    pub(crate) fn take(&mut self, arrival: f64, bytes: &[u8]) -> Taken {
        match self.client.receive(bytes, arrival) {
            Ok(Some(Event::Server(info))) => return Taken::Server(info),
            Ok(Some(Event::Echo(e))) => {
                self.estimate.push(Exchange { sent: e.sent, other: e.server, received: e.received });
            }
            Ok(Some(Event::Frame(_, poses))) => {
                if self.is_restarted(poses.first().and_then(|p| p.source_time), arrival) {
                    self.estimate.forget();
                    self.client.restart();
                    self.first_frame = None;
                    // Its bodies may have got other numbers: these poses might bear wrong names.
                    return Taken::Nothing;
                }
                let first = *self.first_frame.get_or_insert(arrival);
                // Names come a moment after the first frames; a server that never tells them is listened to all the same.
                if !self.client.names().is_empty() || arrival - first > PATIENCE_FOR_NAMES {
                    return Taken::Frame(Batch { poses, clock: self.estimate.offset() });
                }
            }
            _ => {}
        }
        Taken::Nothing
    }
}

/// Reads a stream of OpenIGTLink.
#[derive(Debug, Default)]
pub(crate) struct IgtlDecoder {
    parser: Parser,
    ready: VecDeque<Batch>,
    /// Messages of each type and device.
    pub(crate) devices: BTreeMap<String, u64>,
    /// When each tool, and when anything, was last told of, s.
    pub(crate) tools: BTreeMap<String, Told>,
    pub(crate) last: Option<f64>,
    /// Messages that could not be read, and why the last could not.
    pub(crate) dropped: u64,
    pub(crate) fault: Option<String>,
}

/// Devices and tools that are remembered at most; a server that sends ever new names is misconfigured.
const MOST_NAMES: usize = 256;
/// Longest name of a tool, bytes.
const LONGEST_NAME: usize = 256;

/// What was last told of a tool.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Told {
    /// When it was told of, and when it was last told of anew, s.
    pub(crate) at: f64,
    pub(crate) anew: f64,
    /// Its time on the server's clock and its pose.
    last: (Option<f64>, Option<Rigid<Tracker, Tool>>),
}

impl IgtlDecoder {
    /// Notes a pose. One that comes again with the time that it was measured at is no new one: of a tool that is out of view, or
    /// of a server that hangs.
    fn note(&mut self, pose: &mut TimedPose) {
        let (at, last) = (pose.arrival_time, (pose.source_time, pose.tracker_from_tool));
        if !self.tools.contains_key(&pose.name) && self.tools.len() >= MOST_NAMES {
            return;
        }
        let told = self.tools.entry(pose.name.clone()).or_insert(Told { at, anew: at, last: (None, None) });
        told.at = at;
        if pose.source_time.is_some() && pose.tracker_from_tool.is_some() && told.last == last {
            (pose.tracker_from_tool, pose.quality) = (None, Quality::Missing(Missing::Repeated));
        } else {
            (told.anew, told.last) = (at, last);
        }
    }

    /// A new connection begins: what is unfinished of the last one is forgotten.
    pub(crate) fn begin(&mut self) {
        self.parser = Parser::default();
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
                    let mut told = poses(&m, arrival);
                    if told.iter().any(|p| p.name.len() > LONGEST_NAME) {
                        self.dropped += 1;
                        self.fault = Some(format!("a tool's name is longer than {LONGEST_NAME} bytes"));
                        told.retain(|p| p.name.len() <= LONGEST_NAME);
                    }
                    told.iter_mut().for_each(|pose| self.note(pose));
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
            None => self.ready.push_back(Batch { poses, clock: None }),
        }
    }

    /// The next frame.
    pub(crate) fn next(&mut self) -> Option<Batch> {
        self.ready.pop_front()
    }
}
