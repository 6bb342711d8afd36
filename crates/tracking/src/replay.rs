//! A recording played again: the same bytes through the same decoders, at the times of then.

use crate::clock::seconds;
use crate::decode::{IgtlDecoder, NatNetDecoder, Taken};
use crate::{Batch, Health, ReplayAddress, Source, TrackingError};
use monro_wire::natnet::ClientOptions;
use monro_wire::openigtlink::IgtlError;
use monro_wire::recording::{Protocol, Recording};
use std::collections::VecDeque;
use std::path::PathBuf;
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
    path: PathBuf,
    /// Why the stream cannot be followed any more.
    broken: Option<IgtlError>,
}

impl Replay {
    pub(crate) fn open(address: &ReplayAddress) -> Result<Self, TrackingError> {
        let path = address.path.clone();
        let file = match std::fs::read(&path) {
            Ok(file) => file,
            Err(error) => return Err(TrackingError::File { path, error }),
        };
        let unreadable = |error| TrackingError::Recording { path: path.clone(), error };
        let recording = Recording::read(&file).map_err(unreadable)?;
        let options = ClientOptions { force_version: address.version, up: address.up, bitstream: None };
        let decoder = match recording.protocol() {
            Protocol::NatNet => Decoder::NatNet(Box::new(NatNetDecoder::new(options, address.stamps))),
            Protocol::OpenIgtLink => Decoder::OpenIgtLink(Box::new(IgtlDecoder::new(address.stamps))),
        };
        Ok(Self {
            decoder,
            start: recording.start(),
            cut_off: recording.cut_off(),
            records: in_order(recording.records().iter().map(|r| (r.since_start, r.bytes.to_vec())).collect()),
            ready: VecDeque::new(),
            fast: address.fast,
            begun: None,
            now: seconds(recording.start(), 0),
            broken: None,
            path,
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
                self.broken = decoder.take(self.now, bytes).err();
                self.ready.extend(std::iter::from_fn(|| decoder.next()));
            }
        }
    }
}

/// Records came one after the other: one with a time before both of the last ones' has a damaged time, and came with the last one
/// at the earliest; one beyond the next one's came with that at the latest.
fn in_order(mut records: VecDeque<(u64, Vec<u8>)>) -> VecDeque<(u64, Vec<u8>)> {
    for i in 2..records.len() {
        let [before, last, own] = [i - 2, i - 1, i].map(|k| records[k].0);
        if own < before && own < last {
            records[i].0 = last;
        }
    }
    let mut next = u64::MAX;
    for (since, _) in records.iter_mut().rev() {
        *since = next.min(*since);
        next = *since;
    }
    records
}

impl Replay {
    /// Messages that could not be read, and why the last could not.
    fn unread(&self) -> (u64, String) {
        match &self.decoder {
            Decoder::NatNet(decoder) => {
                let counters = decoder.client.counters();
                (counters.malformed, counters.last_error.as_ref().map(ToString::to_string).unwrap_or_default())
            }
            Decoder::OpenIgtLink(decoder) => (decoder.dropped, decoder.fault.clone().unwrap_or_default()),
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
            if let Some(error) = self.broken.take() {
                let (since_s, left) = (self.now - seconds(self.start, 0), self.records.len());
                self.records.clear();
                return Err(TrackingError::Damaged { path: self.path.clone(), since_s, left, error: Box::new(error) });
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

    fn diagnosis(&self, _: &[&str]) -> Health {
        if !self.records.is_empty() {
            return Health::well(format!("{} records of the recording are left", self.records.len()));
        }
        let (unread, why) = self.unread();
        let mut words = "the recording has ended".to_owned();
        if unread > 0 {
            words += &format!("; {unread} of its messages could not be read (the last: {why})");
        }
        if self.cut_off > 0 {
            words += &format!("; its last record was cut short, {} bytes of it were left out", self.cut_off);
        }
        Health { well: unread == 0 && self.cut_off == 0, words }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_damaged_time_early_or_late_pulled_others_along() {
        let times = |given: &[u64]| -> Vec<u64> {
            in_order(given.iter().map(|&t| (t, Vec::new())).collect()).into_iter().map(|r| r.0).collect()
        };
        assert_eq!(times(&[1, 2, 3, 4]), [1, 2, 3, 4]);
        assert_eq!(times(&[1, 2, 0, 4]), [1, 2, 2, 4]);
        assert_eq!(times(&[1, 2, 900, 4]), [1, 2, 4, 4]);
        assert_eq!(times(&[1, 2, 3, 0]), [1, 2, 3, 3]);
        assert_eq!(times(&[900, 2, 3, 4]), [2, 2, 3, 4]);
    }
}
