//! A fake PLUS server: streams a scene as TRANSFORM messages to everyone who connects.

use crate::{Clock, Scene, TOOLS, TrackingError};
use monro_guidance::Random;
use monro_wire::openigtlink::{Content, HeaderVersion, Message, Parser, Timestamp, ToolStatus, Verb};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, SocketAddrV4, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Bytes that may wait for a slow client; frames beyond are left out for it.
const QUEUE: usize = 256 << 10;

/// How a fake PLUS streams.
#[derive(Debug, Clone, Copy)]
pub struct IgtlFake {
    /// Where it listens; port 0 for any.
    pub listen: SocketAddrV4,
    /// Header version. Version 1 has no status: lost tools are then not sent at all.
    pub version: HeaderVersion,
    /// Frames per second.
    pub rate: f64,
    /// Frames are late by up to this, s, at random.
    pub jitter: f64,
}

struct Peer {
    stream: TcpStream,
    parser: Parser,
    waiting: Vec<u8>,
}

impl Peer {
    fn new(stream: TcpStream) -> std::io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, parser: Parser::new(1 << 20), waiting: Vec::new() })
    }

    /// Reads what the peer asks and answers it; `false` when it has gone.
    fn listen(&mut self) -> bool {
        let mut buffer = [0u8; 4096];
        loop {
            match self.stream.read(&mut buffer) {
                Ok(0) => return false,
                Ok(n) => self.parser.push(&buffer[..n]),
                Err(e) if e.kind() == ErrorKind::WouldBlock => break,
                Err(_) => return false,
            }
        }
        while let Some(message) = self.parser.next_message() {
            if self.parser.is_broken() {
                return false;
            }
            if let Ok(m) = message {
                self.waiting.extend(answer(&m).into_iter().flat_map(|a| a.encode().unwrap_or_default()));
            }
        }
        true
    }

    /// Sends what is waiting, as far as it goes; `false` when the peer has gone.
    fn flush(&mut self) -> bool {
        while !self.waiting.is_empty() {
            match self.stream.write(&self.waiting) {
                Ok(0) => return false,
                Ok(n) => drop(self.waiting.drain(..n)),
                Err(e) if e.kind() == ErrorKind::WouldBlock => return true,
                Err(_) => return false,
            }
        }
        true
    }
}

/// Streams run without being asked for; who asks all the same is told that they do.
fn answer(m: &Message) -> Option<Message> {
    match &m.content {
        Content::Query { verb: Verb::Get, of, .. } if of == "CAPABIL" => {
            let known = ["TRANSFORM", "GET_CAPABIL", "STT_TRANS", "STP_TRANS"].map(str::to_owned).to_vec();
            Some(Message::v1("Monro", None, Content::Capability(known)))
        }
        Content::Query { verb: Verb::Start | Verb::Stop, of, .. } => {
            let accepted = matches!(of.as_str(), "TRANS" | "TRANSFOR" | "TRANSFORM");
            Some(Message::v1("Monro", None, Content::Answer { of: of.clone(), accepted }))
        }
        _ => None,
    }
}

/// Runs until `stop` is set. `ready` is told the address on which it listens.
///
/// # Errors
/// When the socket cannot be opened.
pub fn run_fake_igtl(
    fake: &IgtlFake,
    scene: &mut Scene,
    stop: &AtomicBool,
    ready: impl FnOnce(SocketAddr),
) -> Result<(), TrackingError> {
    let listener = TcpListener::bind(fake.listen)
        .map_err(|error| TrackingError::Listen { address: fake.listen.to_string(), error })?;
    listener.set_nonblocking(true)?;
    ready(listener.local_addr()?);
    let (clock, mut random) = (Clock::new(), Random::new(98));
    let start = clock.now();
    let mut peers: Vec<Peer> = Vec::new();
    for frame in 0u32.. {
        let exposed = f64::from(frame) / fake.rate;
        let due = start + exposed + fake.jitter * random.uniform();
        std::thread::sleep(Duration::from_secs_f64((due - clock.now()).max(0.0)));
        if stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        while let Ok((stream, _)) = listener.accept() {
            peers.extend(Peer::new(stream));
        }
        let bytes = encode(fake, scene, exposed, start, frame)?;
        peers.retain_mut(|p| {
            let here = p.listen();
            if p.waiting.len() + bytes.len() <= QUEUE {
                p.waiting.extend_from_slice(&bytes);
            }
            here && p.flush()
        });
    }
    Ok(())
}

/// One frame: a TRANSFORM `ToolToTracker` for each tool.
fn encode(fake: &IgtlFake, scene: &mut Scene, exposed: f64, start: f64, frame: u32) -> Result<Vec<u8>, TrackingError> {
    let time = Timestamp::from_seconds(start + exposed);
    let mut out = Vec::new();
    for (i, (tool, pose)) in (0u32..).zip(TOOLS.into_iter().zip(scene.seen(exposed))) {
        let status = if pose.is_some() { ToolStatus::Ok } else { ToolStatus::Missing };
        let id = frame.wrapping_mul(TOOLS.len() as u32).wrapping_add(i + 1);
        let mut message = Message::transform(format!("{tool}ToTracker"), time, id, pose.as_ref(), status);
        if fake.version == HeaderVersion::V1 {
            if pose.is_none() {
                continue;
            }
            message = Message::v1(message.device, time, message.content);
        }
        out.extend(message.encode()?);
    }
    Ok(out)
}
