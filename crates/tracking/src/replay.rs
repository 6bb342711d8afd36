//! A recording played again: the same bytes through the same decoders, at the times of then.

use crate::clock::seconds;
use crate::decode::{IgtlDecoder, NatNetDecoder, Taken};
use crate::{Batch, ReplayAddress, Source, TrackingError};
use monro_wire::natnet::ClientOptions;
use monro_wire::recording::{Protocol, Recording};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

enum Decoder {
    NatNet(Box<NatNetDecoder>),
    OpenIgtLink(Box<IgtlDecoder>),
}

/// A recording being played. Its clock is that of the recording.
pub(crate) struct Replay {
    decoder: Decoder,
    start: u64,
    cut_off: usize,
    /// Nanoseconds since the start, and what came then.
    records: VecDeque<(u64, Vec<u8>)>,
    ready: VecDeque<Batch>,
    fast: bool,
    begun: Option<Instant>,
    now: f64,
}

impl Replay {
    pub(crate) fn open(address: &ReplayAddress) -> Result<Self, TrackingError> {
        let path = address.path.clone();
        let file = match std::fs::read(&path) {
            Ok(file) => file,
            Err(error) => return Err(TrackingError::File { path, error }),
        };
        let recording = Recording::read(&file).map_err(|error| TrackingError::Recording { path, error })?;
        let options = ClientOptions { force_version: address.version, up: address.up, bitstream: None };
        let decoder = match recording.protocol() {
            Protocol::NatNet => Decoder::NatNet(Box::new(NatNetDecoder::new(options))),
            Protocol::OpenIgtLink => Decoder::OpenIgtLink(Box::default()),
        };
        Ok(Self {
            decoder,
            start: recording.start(),
            cut_off: recording.cut_off(),
            records: recording.records().iter().map(|r| (r.since_start, r.bytes.to_vec())).collect(),
            ready: VecDeque::new(),
            fast: address.fast,
            begun: None,
            now: seconds(recording.start(), 0),
        })
    }

    fn play(&mut self, since: u64, bytes: &[u8]) {
        self.now = seconds(self.start, since);
        match &mut self.decoder {
            Decoder::NatNet(decoder) => {
                if let Taken::Frame(batch) = decoder.take(self.now, bytes) {
                    self.ready.push_back(batch);
                }
            }
            // An empty piece is where a new connection began.
            Decoder::OpenIgtLink(decoder) if bytes.is_empty() => decoder.begin(),
            Decoder::OpenIgtLink(decoder) => {
                if decoder.take(self.now, bytes).is_err() {
                    self.records.clear();
                }
                self.ready.extend(std::iter::from_fn(|| decoder.next()));
            }
        }
    }
}

impl Source for Replay {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        let begun = *self.begun.get_or_insert_with(Instant::now);
        let end = Instant::now() + wait;
        loop {
            if let Some(batch) = self.ready.pop_front() {
                return Ok(Some(batch));
            }
            let Some((since, _)) = self.records.front() else { return Ok(None) };
            let due = begun + Duration::from_nanos(*since);
            if !self.fast && due > end {
                std::thread::sleep(end.saturating_duration_since(Instant::now()));
                self.now = seconds(self.start, begun.elapsed().as_nanos().try_into().unwrap_or(u64::MAX));
                return Ok(Some(Batch::default()));
            }
            if !self.fast {
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
            }
            if let Some((since, bytes)) = self.records.pop_front() {
                self.play(since, &bytes);
            }
        }
    }

    fn now(&self) -> f64 {
        self.now
    }

    fn diagnosis(&self, _: &[&str]) -> String {
        match self.records.len() {
            0 => "the recording has ended".to_owned(),
            n => format!("{n} records of the recording are left"),
        }
    }

    fn facts(&self) -> Vec<String> {
        let cut =
            if self.cut_off > 0 { format!(", {} bytes of an unfinished one", self.cut_off) } else { String::new() };
        let protocol = match self.decoder {
            Decoder::NatNet(_) => Protocol::NatNet,
            Decoder::OpenIgtLink(_) => Protocol::OpenIgtLink,
        };
        vec![format!("{protocol:?} recording, {} records left{cut}", self.records.len())]
    }
}
