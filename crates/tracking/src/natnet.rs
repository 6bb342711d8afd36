//! A NatNet client on UDP sockets.

use crate::decode::{NatNetDecoder, Taken};
use crate::late::DELAYED;
use crate::{Batch, Clock, Health, NatNetAddress, Recorder, Source, TrackingError};
use monro_guidance::clock::Expiry;
use monro_wire::natnet::{ClientOptions, DATA_PORT, Diagnosis, MULTICAST_GROUP, MessageId, ServerInfo, split};
use monro_wire::recording::Protocol;
use socket2::{Domain, Socket, Type};
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, ToSocketAddrs, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

/// How often the client is asked whether it has something to say.
const TICK: Duration = Duration::from_millis(20);

/// Datagrams that wait at most: ten seconds of a quick camera system.
const MOST_WAITING: usize = 4096;
/// A sender of frames that has been silent for this long may be replaced by another on its machine, and a server that was asked and is
/// silent from the beginning by another machine, ns.
const SILENCE: u64 = 1_000_000_000;
/// Foreign senders that are remembered at most.
const MOST_STRANGERS: usize = 4;

/// Nanoseconds since the start of the clock, and what arrived then from whom.
type Arrived = (u64, SocketAddr, Vec<u8>);

/// A NatNet client with its sockets; each of them is read by a thread of its own, so that arrival times are right.
#[derive(Debug)]
pub(crate) struct NatNetSource {
    decoder: NatNetDecoder,
    clock: Clock,
    command: UdpSocket,
    server: SocketAddr,
    address: NatNetAddress,
    interface: Ipv4Addr,
    /// When it was opened, ns.
    opened: u64,
    data: Option<(Ipv4Addr, u16)>,
    arrivals: Receiver<Arrived>,
    sender: SyncSender<Arrived>,
    stop: Arc<AtomicBool>,
    recorder: Option<Recorder>,
    notes: Vec<String>,
    /// Who sends the frames, and when last (ns).
    streamer: Option<(SocketAddr, u64)>,
    /// Who answers our questions.
    answers_from: Option<IpAddr>,
    strangers: BTreeSet<SocketAddr>,
}

impl NatNetSource {
    pub(crate) fn open(
        address: &NatNetAddress,
        clock: Clock,
        recorder: Option<Recorder>,
    ) -> Result<Self, TrackingError> {
        let server = resolve(&address.host, address.port)?;
        let interface = match address.interface {
            Some(i) => i,
            None => facing(server)?,
        };
        let bind = address.interface.unwrap_or(Ipv4Addr::UNSPECIFIED);
        let refused = |error| TrackingError::Listen { address: bind.to_string(), error };
        let command = UdpSocket::bind((bind, 0)).map_err(refused)?;
        let (sender, arrivals) = sync_channel(MOST_WAITING);
        let stop = Arc::new(AtomicBool::new(false));
        listen(command.try_clone()?, clock, sender.clone(), Arc::clone(&stop))?;
        let options = ClientOptions { force_version: address.version, up: address.up, bitstream: address.bitstream };
        let mut source = Self {
            decoder: NatNetDecoder::new(options, address.stamps),
            clock,
            command,
            server,
            address: address.clone(),
            interface,
            opened: clock.nanos(),
            data: None,
            arrivals,
            sender,
            stop,
            recorder,
            notes: Vec::new(),
            streamer: None,
            answers_from: None,
            strangers: BTreeSet::new(),
        };
        // With a forced version frames may be read before, or without, any word of the server.
        if address.multicast.is_some() || address.version.is_some() {
            source.open_data(None)?;
        }
        Ok(source)
    }

    /// Opens the data socket that the server's announcement, or the address, asks for, unless it is open already.
    fn open_data(&mut self, info: Option<&ServerInfo>) -> Result<(), TrackingError> {
        let clock = info.and_then(|i| i.clock);
        let group = self.address.multicast.unwrap_or_else(|| clock.map_or(MULTICAST_GROUP, |c| c.group).into());
        let port = self.address.data_port.unwrap_or_else(|| clock.map_or(DATA_PORT, |c| c.data_port));
        if self.data == Some((group, port)) {
            return Ok(());
        }
        let multicast =
            !self.address.unicast && (self.address.multicast.is_some() || clock.is_none_or(|c| c.multicast));
        match shared_socket(port, multicast.then_some((group, self.interface))) {
            Ok(socket) => listen(socket, self.clock, self.sender.clone(), Arc::clone(&self.stop))?,
            // A unicast server may answer to the command socket just as well; another program may have this port.
            Err(e) if !multicast => {
                self.notes.push(format!("data port {port} is not free ({e}); using the command port"));
            }
            Err(error) => return Err(TrackingError::Join { group, port, interface: self.interface, error }),
        }
        self.data = Some((group, port));
        Ok(())
    }

    /// The group that was asked for and the one that the server announces, where they differ.
    fn other_group(&self) -> Option<[Ipv4Addr; 2]> {
        let ours = self.address.multicast?;
        let theirs = Ipv4Addr::from(self.decoder.client.server()?.clock?.group);
        (ours != theirs).then_some([ours, theirs])
    }

    /// Whether a datagram is to be heard. Several servers may send to one group and port: frames are taken from one machine,
    /// that which was asked, or where it says nothing at all the first other one; answers from the machine that was asked, or, where another has
    /// answered in its place (it has several addresses), from that.
    fn is_heard(&mut self, since: u64, from: SocketAddr, bytes: &[u8]) -> bool {
        if !split(bytes).is_ok_and(|(header, _)| header.id == MessageId::Frame) {
            if from.ip() == self.server.ip() || self.answers_from.is_none_or(|a| a == from.ip()) {
                self.answers_from = Some(from.ip());
                return true;
            }
            self.note_stranger(from);
            return false;
        }
        let heard = match self.streamer {
            Some((s, last)) => {
                let again = s.ip() == from.ip() && since.saturating_sub(last) >= SILENCE;
                s == from || again || self.nearness(from) > self.nearness(s)
            }
            // One that nobody asked stands in for a server that has not said a word for a while.
            None => {
                from.ip() == self.server.ip()
                    || self.answers_from != Some(self.server.ip()) && since.saturating_sub(self.opened) >= SILENCE
            }
        };
        match heard {
            true => self.streamer = Some((from, since)),
            false => self.note_stranger(from),
        }
        heard
    }

    /// How much an address is that of the server that was asked: its machine, then its port.
    fn nearness(&self, a: SocketAddr) -> (bool, bool) {
        (a.ip() == self.server.ip(), a == self.server)
    }

    /// That frames are old when they arrive, by the clock of the cameras or, where that is not known, by what they lag.
    fn late(&self) -> Option<String> {
        let age = self.decoder.age;
        let no_clock = self.decoder.estimate.offset().is_none();
        let held_up = self.decoder.late.words("each frame").filter(|_| no_clock);
        let by = if no_clock { "what the server says of its own delay" } else { "the server's own clock" };
        held_up.or_else(|| {
            (age >= Expiry::default().stale)
                .then(|| format!("frames are {age:.2} s old when they arrive, by {by}: {DELAYED}"))
        })
    }

    fn note_stranger(&mut self, from: SocketAddr) {
        if self.strangers.len() < MOST_STRANGERS {
            self.strangers.insert(from);
        }
    }

    fn take(&mut self, (since, from, bytes): Arrived) -> Result<Option<Batch>, TrackingError> {
        if !self.is_heard(since, from, &bytes) {
            return Ok(None);
        }
        if let Some(r) = &mut self.recorder {
            r.write(Protocol::NatNet, since, &bytes)?;
        }
        match self.decoder.take(self.clock.at(since), &bytes) {
            Taken::Server(info) => self.open_data(Some(&info)).map(|()| None),
            Taken::Frame(batch) => Ok(Some(batch)),
            Taken::Nothing => Ok(None),
        }
    }
}

impl Drop for NatNetSource {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A server that hears no good-bye finds out by itself.
        let _ = self.command.send_to(&self.decoder.client.disconnect(), self.server);
    }
}

impl Source for NatNetSource {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        let end = Instant::now() + wait;
        loop {
            for datagram in self.decoder.client.poll(self.clock.now()) {
                // A refused datagram (port closed) is the same as no answer.
                let _ = self.command.send_to(&datagram, self.server);
            }
            let left = end.saturating_duration_since(Instant::now());
            if let Ok(arrived) = self.arrivals.recv_timeout(left.min(TICK))
                && let Some(batch) = self.take(arrived)?
            {
                return Ok(Some(batch));
            }
            if left.is_zero() {
                return Ok(Some(Batch::default()));
            }
        }
    }

    fn now(&self) -> f64 {
        self.clock.now()
    }

    fn diagnosis(&self, wanted: &[&str]) -> Health {
        let found = self.decoder.client.diagnosis(self.clock.now(), wanted);
        let well = found.is_well();
        if well && let Some(late) = self.late() {
            return Health::ill(late);
        }
        let silent = matches!(found, Diagnosis::NoData { .. });
        let mut words = match found {
            Diagnosis::NoServer { .. } => format!("{}: {found}", self.server),
            Diagnosis::NoData { multicast: Some(true), .. } if self.address.unicast => {
                format!("{found}; this client was told to use unicast (?unicast=1)")
            }
            Diagnosis::NoData { multicast: Some(true), .. } => match self.other_group() {
                Some([ours, theirs]) => {
                    format!("{found}; it sends to the group {theirs}, this client listens to {ours} (?multicast=)")
                }
                None => format!("{found}; this client listens on interface {} (?interface=)", self.interface),
            },
            found => found.to_string(),
        };
        if let Some(other) = self.strangers.iter().find(|s| silent && s.ip() != self.server.ip()) {
            let (other, asked) = (other.ip(), self.server.ip());
            words += &format!(
                "; {other} sends frames, which are left out since {asked} was asked: give natnet://{other} if they are meant"
            );
        }
        Health { well, words }
    }

    fn facts(&self) -> Vec<String> {
        let mut facts = vec![format!("server {} from interface {}", self.server, self.interface)];
        facts.extend(self.notes.iter().cloned());
        let left_out =
            |s: &SocketAddr| format!("another server, {s}, sends to the same port; what it says is left out");
        facts.extend(self.strangers.iter().map(left_out));
        if let Some(info) = self.decoder.client.server() {
            let [a, b, ..] = info.sender.application;
            let v = info.sender.version();
            facts.push(format!("{} {a}.{b}, NatNet {v}", info.sender.name));
            facts.extend(info.clock.map(|c| {
                let way =
                    if c.multicast { format!("multicast {}", Ipv4Addr::from(c.group)) } else { "unicast".to_owned() };
                format!("data by {way}, port {}", c.data_port)
            }));
        }
        let names: Vec<_> = self.decoder.client.names().values().cloned().collect();
        facts.push(format!("rigid bodies: {}", if names.is_empty() { "none".to_owned() } else { names.join(", ") }));
        let c = self.decoder.client.counters();
        facts.push(format!("{} frames, {} missed, {} malformed", c.frames, c.missed, c.malformed));
        facts.extend(c.last_error.as_ref().map(|e| format!("last fault: {e}")));
        if let Some(o) = self.decoder.estimate.offset() {
            facts.push(clock_fact(o.offset, o.bound));
        }
        facts
    }
}

/// What is known of the server's clock. Both count from the start of something, so that a large offset says nothing.
fn clock_fact(offset: f64, bound: f64) -> String {
    let known = format!("the server's clock is known to {:.2} ms", 1e3 * bound);
    match offset.abs() {
        far if far > 3600.0 => format!("{known} (it counts from another moment than ours)"),
        _ => format!("{known} (it is {offset:.4} s ahead of ours)"),
    }
}

fn resolve(host: &str, port: u16) -> Result<SocketAddr, TrackingError> {
    let unknown = |error| TrackingError::Host { host: host.to_owned(), error };
    let mut found = (host, port).to_socket_addrs().map_err(unknown)?;
    found.find(SocketAddr::is_ipv4).ok_or_else(|| TrackingError::NoIpv4(host.to_owned()))
}

/// Our address on the interface that faces the server. Nothing is sent.
fn facing(server: SocketAddr) -> Result<Ipv4Addr, TrackingError> {
    let probe = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    probe.connect(server).map_err(|error| TrackingError::NoWay { server, error })?;
    match probe.local_addr()? {
        SocketAddr::V4(a) => Ok(*a.ip()),
        SocketAddr::V6(a) => Err(TrackingError::NoIpv4(a.to_string())),
    }
}

/// A socket on a port that others may listen on too, in a multicast group if one is given.
fn shared_socket(port: u16, group: Option<(Ipv4Addr, Ipv4Addr)>) -> std::io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, None)?;
    socket.set_reuse_address(group.is_some())?;
    socket.bind(&SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, port).into())?;
    let socket = UdpSocket::from(socket);
    if let Some((group, interface)) = group {
        socket.join_multicast_v4(&group, &interface)?;
    }
    Ok(socket)
}

fn listen(
    socket: UdpSocket,
    clock: Clock,
    sender: SyncSender<Arrived>,
    stop: Arc<AtomicBool>,
) -> Result<(), TrackingError> {
    socket.set_read_timeout(Some(Duration::from_millis(100)))?;
    let read = move || {
        let mut buffer = vec![0u8; 65_536];
        while !stop.load(Ordering::Relaxed) {
            let Ok((n, from)) = socket.recv_from(&mut buffer) else { continue };
            // Where nobody takes them any more in time they are lost, as datagrams are: those that wait keep their times.
            if let Err(TrySendError::Disconnected(_)) = sender.try_send((clock.nanos(), from, buffer[..n].to_vec())) {
                return;
            }
        }
    };
    std::thread::Builder::new().name("natnet".to_owned()).spawn(read)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TrackerUrl;

    #[test]
    fn the_offset_of_a_clock_was_told_in_ten_digits_of_seconds() {
        assert!(!clock_fact(-1_795_385_035.258_362, 1.2e-4).contains("1795"));
        assert!(clock_fact(0.012_34, 1.2e-4).contains("0.12 ms (it is 0.0123 s"));
    }

    /// Two servers that sent to one group and port used to be mixed into one stream.
    #[test]
    fn frames_are_taken_from_one_sender_the_nearest_to_the_server_that_was_asked() {
        let url = "natnet://127.0.0.1:1510?unicast=1".parse();
        let Ok(TrackerUrl::NatNet(address)) = url else { panic!("{url:?}") };
        let mut source = NatNetSource::open(&address, Clock::new(), None).expect("sockets");
        let (frame, other) = ([7, 0, 0, 0], [8, 0, 0, 0]);
        let mut heard =
            |ms: u64, from: &str, bytes: &[u8]| source.is_heard(ms * 1_000_000, from.parse().expect("address"), bytes);
        assert!(!heard(0, "10.0.0.2:1511", &frame) && !heard(8, "10.0.0.3:1511", &frame), "who was asked comes first");
        assert!(heard(1200, "10.0.0.2:1511", &frame) && !heard(1208, "10.0.0.3:1511", &frame));
        assert!(heard(1209, "10.0.0.3:1511", &other), "only frames are of one sender");
        assert!(heard(1216, "127.0.0.1:4000", &frame), "the server's own machine");
        assert!(!heard(1224, "10.0.0.2:1511", &frame) && !heard(1225, "127.0.0.1:5000", &frame));
        assert!(heard(1232, "127.0.0.1:1510", &frame) && !heard(1240, "127.0.0.1:4000", &frame));
        assert!(heard(2300, "127.0.0.1:4000", &frame), "one that has fallen silent may be replaced");
        assert!(source.facts().iter().any(|f| f.contains("10.0.0.3:1511")), "{:?}", source.facts());
    }

    /// Two camera systems on one network, of which the one that was asked is paused: the other one's poses were shown as its.
    #[test]
    fn frames_of_another_machine_were_taken_once_the_server_that_was_asked_was_silent() {
        let Ok(TrackerUrl::NatNet(address)) = "natnet://127.0.0.1:9?unicast=1".parse() else { panic!("an address") };
        let (frame, info) = ([7, 0, 0, 0], [1, 0, 0, 0]);
        for first in [frame, info] {
            let mut source = NatNetSource::open(&address, Clock::new(), None).expect("sockets");
            let mut heard =
                |s: u64, from: &str, bytes: &[u8]| source.is_heard(s * SILENCE, from.parse().expect("address"), bytes);
            assert!(heard(0, "127.0.0.1:9", &first));
            assert!((1..90).all(|s| !heard(s, "10.0.0.3:1511", &frame)));
            assert!(heard(90, "127.0.0.1:9", &frame) && !heard(95, "10.0.0.3:1511", &frame));
            assert!(source.facts().iter().any(|f| f.contains("10.0.0.3:1511")), "{:?}", source.facts());
        }
    }

    #[test]
    fn names_and_versions_were_taken_from_any_machine() {
        let Ok(TrackerUrl::NatNet(address)) = "natnet://127.0.0.1:9?unicast=1".parse() else { panic!("an address") };
        let mut source = NatNetSource::open(&address, Clock::new(), None).expect("sockets");
        let heard = |source: &mut NatNetSource, from: &str, id: MessageId| {
            source.is_heard(
                0,
                from.parse().expect("place"),
                &[&id.number().to_le_bytes()[..], &8u16.to_le_bytes(), &[0; 8]].concat(),
            )
        };
        // A server with several addresses may answer from another than the one that was asked.
        assert!(heard(&mut source, "127.0.0.9:9", MessageId::ServerInfo));
        assert!(!heard(&mut source, "127.0.0.8:9", MessageId::ModelDefinition));
        assert!(heard(&mut source, "127.0.0.1:1510", MessageId::ServerInfo));
        for id in [MessageId::ServerInfo, MessageId::ModelDefinition, MessageId::Response] {
            assert!(!heard(&mut source, "127.0.0.9:9", id) && heard(&mut source, "127.0.0.1:9", id));
        }
        assert!(source.facts().iter().any(|f| f.contains("127.0.0.9")), "{:?}", source.facts());
    }
}
