//! An OpenIGTLink client on a TCP socket; it connects again when the other side goes away.

use crate::decode::IgtlDecoder;
use crate::told::Told;
use crate::{Batch, Clock, Health, IgtlAddress, Recorder, Source, TrackingError};
use monro_wire::openigtlink::{Content, Message, StreamRequest, Verb};
use monro_wire::recording::Protocol;
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// What has not been told of for so long is missing, s.
const SILENT_S: f64 = 2.0;
/// What has been sent as not seen for so long is out of view, s.
const UNSEEN_S: f64 = 0.5;

enum Arrived {
    Connected,
    Bytes(Vec<u8>),
    Closed(String),
}

/// Nanoseconds since the start of the clock, and what happened then.
type Timed = (u64, Arrived);

/// An OpenIGTLink client.
pub(crate) struct IgtlSource {
    place: String,
    clock: Clock,
    decoder: IgtlDecoder,
    arrivals: Receiver<Timed>,
    stop: Arc<AtomicBool>,
    recorder: Option<Recorder>,
    connected: bool,
    trouble: Option<String>,
}

impl IgtlSource {
    pub(crate) fn open(address: &IgtlAddress, clock: Clock, recorder: Option<Recorder>) -> Result<Self, TrackingError> {
        let hello = address.start.as_deref().map(start_query).transpose()?;
        // Bounded: a peer that floods us waits in its own socket.
        let (sender, arrivals) = sync_channel(256);
        let stop = Arc::new(AtomicBool::new(false));
        let place = format!("{}:{}", address.host, address.port);
        let caller = Caller { host: address.host.clone(), port: address.port, hello, clock, stop: Arc::clone(&stop) };
        std::thread::Builder::new().name("igtl".to_owned()).spawn(move || caller.connect_forever(&sender))?;
        let decoder = IgtlDecoder::new(address.stamps);
        Ok(Self { place, clock, decoder, arrivals, stop, recorder, connected: false, trouble: None })
    }

    fn take(&mut self, (since, arrived): Timed) -> Result<(), TrackingError> {
        match arrived {
            Arrived::Connected => {
                self.record(since, &[])?;
                self.decoder.begin();
                (self.connected, self.trouble) = (true, None);
            }
            Arrived::Closed(why) => (self.connected, self.trouble) = (false, Some(why)),
            Arrived::Bytes(bytes) => {
                self.record(since, &bytes)?;
                let broken = |error| TrackingError::Stream { place: self.place.clone(), error };
                self.decoder.take(self.clock.at(since), &bytes).map_err(broken)?;
            }
        }
        Ok(())
    }

    fn record(&mut self, since: u64, bytes: &[u8]) -> Result<(), TrackingError> {
        self.recorder.as_mut().map_or(Ok(()), |r| r.write(Protocol::OpenIgtLink, since, bytes))
    }

    /// What is wrong with a tool, if something is.
    fn missing(&self, wanted: &str, now: f64) -> Option<String> {
        let told = self.decoder.tools.iter().filter(|(name, _)| is_tool(name, wanted)).map(|(_, told)| told);
        match told.max_by(|a, b| a.at.total_cmp(&b.at)) {
            Some(Told { seen, unseen: Some(why), anew, .. }) if now - anew <= SILENT_S && now - seen > UNSEEN_S => {
                Some(format!("'{wanted}' is sent, but has not been seen for {:.1} s ({})", now - seen, why.name()))
            }
            Some(told) if now - told.anew <= SILENT_S => told.late.words(&format!("'{wanted}'")),
            Some(told) if now - told.at <= SILENT_S => Some(format!(
                "'{wanted}' has been sent with one and the same pose and time for {:.1} s: it is out of view, or the server hangs",
                now - told.anew
            )),
            Some(told) => Some(format!("'{wanted}' was last sent {:.1} s ago", now - told.at)),
            None => {
                let sent = self.decoder.devices.keys().cloned().collect::<Vec<_>>().join(", ");
                Some(format!("'{wanted}' is not sent (sent: {sent})"))
            }
        }
    }

    fn trouble(&self) -> Option<&String> {
        self.trouble.as_ref().or(self.decoder.errors.values().next()).or(self.decoder.fault.as_ref())
    }
}

/// `STT_x`: servers of tracking data that wait to be asked (`x` is TDATA or QTDATA) send as fast as they can.
fn start_query(of: &str) -> Result<Vec<u8>, TrackingError> {
    let stream = Some(StreamRequest { interval_ms: 0, coordinate_system: String::new() });
    Ok(Message::v1("Monro", None, Content::Query { verb: Verb::Start, of: of.to_owned(), stream }).encode()?)
}

impl Drop for IgtlSource {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Source for IgtlSource {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        let end = Instant::now() + wait;
        for turn in 0u64.. {
            if let Some(batch) = self.decoder.next() {
                return Ok(Some(batch));
            }
            let left = end.saturating_duration_since(Instant::now());
            // What is queued already comes without waiting, and a peer may send faster than it is read.
            if turn > 0 && left.is_zero() {
                break;
            }
            match self.arrivals.recv_timeout(left) {
                Ok(arrived) => self.take(arrived)?,
                Err(_) => break,
            }
        }
        Ok(Some(Batch::default()))
    }

    fn now(&self) -> f64 {
        self.clock.now()
    }

    fn diagnosis(&self, wanted: &[&str]) -> Health {
        let place = &self.place;
        let why = self.trouble().map_or(String::new(), |t| format!(" ({t})"));
        if !self.connected {
            return Health::ill(format!("no connection to {place}{why}: is the server running, and its port right?"));
        }
        let devices = &self.decoder.devices;
        if devices.is_empty() {
            return Health::ill(format!(
                "connected to {place}, but no message came{why}: has the server no tool, or does it wait to be asked (?start=TDATA or ?start=QTDATA)?"
            ));
        }
        let now = self.clock.now();
        let silent = self.decoder.last.map_or(0.0, |last| now - last);
        if silent > SILENT_S {
            return Health::ill(format!(
                "nothing has come from {place} for {silent:.1} s, though it is connected{why}"
            ));
        }
        match wanted.iter().find_map(|w| self.missing(w, now)) {
            Some(what) => Health::ill(format!("{what}{why}")),
            None => Health::well(format!("receiving from {place}")),
        }
    }

    fn facts(&self) -> Vec<String> {
        let mut facts =
            vec![format!("server {}, {}", self.place, if self.connected { "connected" } else { "not connected" })];
        facts.extend(self.decoder.devices.iter().map(|(d, n)| format!("{d}: {n} messages")));
        facts.push(format!("{} messages dropped", self.decoder.dropped));
        facts.extend(self.decoder.errors.values().chain(&self.trouble).chain(&self.decoder.fault).cloned());
        facts
    }
}

/// The tool of a device that is named as PLUS does: the `Stylus` of `StylusToTracker`; other names are tools themselves.
pub fn tool_name(device: &str) -> &str {
    device.strip_suffix("ToTracker").filter(|t| !t.is_empty()).unwrap_or(device)
}

/// Whether what is sent under a name is this tool: also without the `ToTracker` that PLUS puts behind.
pub fn is_tool(name: &str, tool: &str) -> bool {
    name == tool || tool_name(name) == tool
}

/// The thread that holds the connection.
struct Caller {
    host: String,
    port: u16,
    hello: Option<Vec<u8>>,
    clock: Clock,
    stop: Arc<AtomicBool>,
}

impl Caller {
    fn connect_forever(&self, sender: &SyncSender<Timed>) {
        let tell = |what| sender.send((self.clock.nanos(), what)).is_ok();
        while !self.stop.load(Ordering::Relaxed) {
            let why = match self.connect() {
                Ok(stream) if tell(Arrived::Connected) => self.read(stream, &tell),
                Ok(_) => return,
                Err(e) => e.to_string(),
            };
            if !tell(Arrived::Closed(why)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(500));
        }
    }

    fn connect(&self) -> std::io::Result<TcpStream> {
        let mut last = std::io::Error::other("the name has no address");
        for address in (self.host.as_str(), self.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, Duration::from_secs(2)) {
                Ok(mut stream) => {
                    stream.set_nodelay(true)?;
                    stream.set_read_timeout(Some(Duration::from_millis(100)))?;
                    stream.write_all(self.hello.as_deref().unwrap_or_default())?;
                    return Ok(stream);
                }
                Err(e) => last = e,
            }
        }
        Err(last)
    }

    /// Reads until the other side closes; says why it ended.
    fn read(&self, mut stream: TcpStream, tell: &impl Fn(Arrived) -> bool) -> String {
        let mut buffer = vec![0u8; 65_536];
        while !self.stop.load(Ordering::Relaxed) {
            match stream.read(&mut buffer) {
                Ok(0) => return "the server closed the connection".to_owned(),
                Ok(n) => {
                    if !tell(Arrived::Bytes(buffer[..n].to_vec())) {
                        break;
                    }
                }
                Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {}
                Err(e) => return e.to_string(),
            }
        }
        "closed".to_owned()
    }
}
