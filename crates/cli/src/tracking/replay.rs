//! A recording played again: the same bytes through the same decoders, at the times of then.

use super::{Batch, Source};
use anyhow::{Context, Result};
use monro_wire::natnet::{Client, ClientOptions, Event};
use monro_wire::openigtlink::{Parser, poses};
use monro_wire::recording::{Protocol, Recording};
use std::collections::VecDeque;
use std::path::Path;
use std::time::{Duration, Instant};

/// A recording being played. Its clock is that of the recording.
pub(super) struct Replay {
    protocol: Protocol,
    start: f64,
    cut_off: usize,
    records: VecDeque<(f64, Vec<u8>)>,
    ready: VecDeque<Batch>,
    client: Client,
    parser: Parser,
    fast: bool,
    begun: Option<Instant>,
    now: f64,
}

impl Replay {
    pub(super) fn open(path: &Path, fast: bool) -> Result<Self> {
        let named = || format!("the recording {}", path.display());
        let file = std::fs::read(path).with_context(named)?;
        let recording = Recording::read(&file).with_context(named)?;
        let start = recording.start() as f64 / 1e9;
        let seconds = |n: u64| n as f64 / 1e9;
        Ok(Self {
            protocol: recording.protocol(),
            start,
            cut_off: recording.cut_off(),
            records: recording.records().iter().map(|r| (seconds(r.since_start), r.bytes.to_vec())).collect(),
            ready: VecDeque::new(),
            client: Client::new(ClientOptions::default()),
            parser: Parser::default(),
            fast,
            begun: None,
            now: start,
        })
    }

    fn play(&mut self, since: f64, bytes: &[u8]) {
        self.now = self.start + since;
        match self.protocol {
            Protocol::NatNet => {
                if let Ok(Some(Event::Frame(_, poses))) = self.client.receive(bytes, self.now) {
                    self.ready.push_back(Batch { poses, clock: None });
                }
            }
            Protocol::OpenIgtLink => {
                self.parser.push(bytes);
                while let Some(message) = self.parser.next_message() {
                    let found = message.map_or(Vec::new(), |m| poses(&m, self.now));
                    if !found.is_empty() {
                        self.ready.push_back(Batch { poses: found, clock: None });
                    }
                    if self.parser.is_broken() {
                        self.records.clear();
                        return;
                    }
                }
            }
        }
    }
}

impl Source for Replay {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>> {
        let begun = *self.begun.get_or_insert_with(Instant::now);
        let end = Instant::now() + wait;
        loop {
            if let Some(batch) = self.ready.pop_front() {
                return Ok(Some(batch));
            }
            let Some((since, _)) = self.records.front() else { return Ok(None) };
            let due = begun + Duration::from_secs_f64(since.clamp(0.0, 1e9));
            if !self.fast && due > end {
                std::thread::sleep(end.saturating_duration_since(Instant::now()));
                self.now = self.start + begun.elapsed().as_secs_f64();
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
        vec![format!("{:?} recording, {} records left{cut}", self.protocol, self.records.len())]
    }
}
