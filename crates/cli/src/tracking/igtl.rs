//! An OpenIGTLink client on a TCP socket; it connects again when the other side goes away.

use super::{Batch, Clock, Recorder, Source};
use anyhow::{Result, anyhow};
use monro_wire::TimedPose;
use monro_wire::openigtlink::{Parser, poses};
use monro_wire::recording::Protocol;
use std::collections::{BTreeMap, VecDeque};
use std::io::Read;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

enum Arrived {
    Connected,
    Bytes(f64, Vec<u8>),
    Closed(String),
}

/// An OpenIGTLink client.
pub(super) struct IgtlSource {
    place: String,
    clock: Clock,
    parser: Parser,
    ready: VecDeque<Batch>,
    arrivals: Receiver<Arrived>,
    stop: Arc<AtomicBool>,
    recorder: Option<Recorder>,
    connected: bool,
    trouble: Option<String>,
    devices: BTreeMap<String, u64>,
    dropped: u64,
}

impl IgtlSource {
    pub(super) fn open(host: String, port: u16, clock: Clock, recorder: Option<Recorder>) -> Result<Self> {
        // Bounded: a peer that floods us waits in its own socket.
        let (sender, arrivals) = sync_channel(256);
        let stop = Arc::new(AtomicBool::new(false));
        let (place, ending) = (format!("{host}:{port}"), Arc::clone(&stop));
        std::thread::Builder::new()
            .name("igtl".to_owned())
            .spawn(move || connect_forever(&host, port, clock, &sender, &ending))?;
        Ok(Self {
            place,
            clock,
            parser: Parser::default(),
            ready: VecDeque::new(),
            arrivals,
            stop,
            recorder,
            connected: false,
            trouble: None,
            devices: BTreeMap::new(),
            dropped: 0,
        })
    }

    fn take(&mut self, arrived: Arrived) -> Result<()> {
        match arrived {
            Arrived::Connected => {
                self.parser = Parser::default();
                (self.connected, self.trouble) = (true, None);
            }
            Arrived::Closed(why) => (self.connected, self.trouble) = (false, Some(why)),
            Arrived::Bytes(arrival, bytes) => {
                if let Some(r) = &mut self.recorder {
                    r.write(Protocol::OpenIgtLink, arrival, &bytes)?;
                }
                self.parser.push(&bytes);
                self.parse(arrival)?;
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

    fn parse(&mut self, arrival: f64) -> Result<()> {
        while let Some(message) = self.parser.next_message() {
            match message {
                Ok(m) => {
                    let poses = poses(&m, arrival);
                    *self.devices.entry(format!("{} {}", m.content.type_name(), m.device)).or_default() += 1;
                    self.add(poses);
                }
                Err(e) if self.parser.is_broken() => return Err(anyhow!(e).context(format!("igtl://{}", self.place))),
                Err(e) => {
                    self.dropped += 1;
                    self.trouble = Some(e.to_string());
                }
            }
        }
        Ok(())
    }
}

impl Drop for IgtlSource {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Source for IgtlSource {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>> {
        let end = Instant::now() + wait;
        loop {
            if let Some(batch) = self.ready.pop_front() {
                return Ok(Some(batch));
            }
            let left = end.saturating_duration_since(Instant::now());
            match self.arrivals.recv_timeout(left) {
                Ok(arrived) => self.take(arrived)?,
                Err(_) => return Ok(Some(Batch::default())),
            }
        }
    }

    fn now(&self) -> f64 {
        self.clock.now()
    }

    fn diagnosis(&self, wanted: &[&str]) -> String {
        let place = &self.place;
        let why = self.trouble.as_ref().map_or(String::new(), |t| format!(" ({t})"));
        if !self.connected {
            return format!("no connection to {place}{why}: is the server running, and its port right?");
        }
        if self.devices.is_empty() {
            return format!(
                "connected to {place}, but no message came{why}: does the server wait for a STT_TDATA, or have no tool?"
            );
        }
        let missing = wanted.iter().find(|w| !self.devices.keys().any(|d| d.ends_with(&format!(" {w}"))));
        match missing {
            Some(name) => {
                format!("'{name}' is not sent (sent: {})", self.devices.keys().cloned().collect::<Vec<_>>().join(", "))
            }
            None => format!("receiving from {place}"),
        }
    }

    fn facts(&self) -> Vec<String> {
        let mut facts =
            vec![format!("server {}, {}", self.place, if self.connected { "connected" } else { "not connected" })];
        facts.extend(self.devices.iter().map(|(d, n)| format!("{d}: {n} messages")));
        facts.push(format!("{} messages dropped", self.dropped));
        facts.extend(self.trouble.clone());
        facts
    }
}

fn connect_forever(host: &str, port: u16, clock: Clock, sender: &SyncSender<Arrived>, stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        let why = match connect(host, port) {
            Ok(stream) => match sender.send(Arrived::Connected) {
                Ok(()) => read(stream, clock, sender, stop),
                Err(_) => return,
            },
            Err(e) => e.to_string(),
        };
        if sender.send(Arrived::Closed(why)).is_err() {
            return;
        }
        std::thread::sleep(Duration::from_millis(500));
    }
}

fn connect(host: &str, port: u16) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::other("the name has no address");
    for address in (host, port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, Duration::from_secs(2)) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(Duration::from_millis(100)))?;
                return Ok(stream);
            }
            Err(e) => last = e,
        }
    }
    Err(last)
}

/// Reads until the other side closes; says why it ended.
fn read(mut stream: TcpStream, clock: Clock, sender: &SyncSender<Arrived>, stop: &AtomicBool) -> String {
    let mut buffer = vec![0u8; 65_536];
    while !stop.load(Ordering::Relaxed) {
        match stream.read(&mut buffer) {
            Ok(0) => return "the server closed the connection".to_owned(),
            Ok(n) => {
                if sender.send(Arrived::Bytes(clock.now(), buffer[..n].to_vec())).is_err() {
                    break;
                }
            }
            Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {}
            Err(e) => return e.to_string(),
        }
    }
    "closed".to_owned()
}
