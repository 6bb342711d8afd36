//! How long a pose takes from the datagram's departure to our hands, on the loopback interface.

use crate::natnet::NatNetSource;
use crate::{Clock, Scene, SceneOptions, Source, TOOLS, TrackerUrl, TrackingError};
use monro_wire::natnet::{Server, ServerOptions, UpAxis, Version};
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

/// How long poses took.
#[derive(Debug, Clone, Default)]
pub struct Latencies {
    /// Of each frame that was handed on, s.
    pub seconds: Vec<f64>,
    /// Frames before the first one that was handed on: a client holds them back until it knows the names of their tools.
    pub before_names: u32,
    /// Frames that never came.
    pub lost: u32,
}

/// Sends `frames` frames at `rate` Hz to a client of our own and measures how long each took to become poses.
///
/// # Errors
/// When the loopback interface does not carry datagrams.
pub fn latencies(frames: u32, rate: f64) -> Result<Latencies, TrackingError> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    let url = format!("natnet://{}?unicast=1", socket.local_addr()?).parse();
    let Ok(TrackerUrl::NatNet(address)) = url else { unreachable!("made just now: {url:?}") };
    let (sender, sent) = channel();
    let server = std::thread::spawn(move || send(&socket, frames, rate, &sender));
    let mut source = NatNetSource::open(&address, Clock::new(), None)?;
    let mut out = Latencies::default();
    let mut last = 0;
    while last < frames {
        let batch = source.next(Duration::from_secs(3))?.unwrap_or_default();
        let taken = Instant::now();
        let Some(time) = batch.poses.first().and_then(|p| p.source_time) else { break };
        // The exposure time of frame n is n / rate: it finds the moment of its departure.
        let number = (time * rate).round() as u32;
        let departure = sent.iter().find(|(n, _): &(u32, Instant)| *n >= number).filter(|(n, _)| *n == number);
        out.seconds.extend(departure.map(|(_, at)| taken.duration_since(at).as_secs_f64()));
        if last == 0 {
            out.before_names = number - 1;
        }
        last = number;
    }
    server.join().map_err(|_| TrackingError::Thread("sends frames"))??;
    out.lost = frames - out.before_names - out.seconds.len() as u32;
    Ok(out)
}

fn send(socket: &UdpSocket, frames: u32, rate: f64, sent: &Sender<(u32, Instant)>) -> Result<(), TrackingError> {
    let mut server = Server::new(ServerOptions {
        version: Version::new(4, 1),
        bodies: TOOLS.map(str::to_owned).to_vec(),
        frequency: 10_000_000,
        data_port: 0,
        multicast: false,
        up: UpAxis::Z,
        rate: rate as f32,
    });
    let mut scene = Scene::new(SceneOptions::default());
    let Some(client) = answer(socket, &mut server, Instant::now() + Duration::from_secs(3))? else { return Ok(()) };
    let begun = Instant::now();
    for number in 1..=frames {
        let exposed = f64::from(number) / rate;
        let poses: Vec<_> = scene.seen(exposed).into_iter().map(|p| (p, 0.3)).collect();
        let bytes = server.frame(&poses, exposed, exposed);
        while answer(socket, &mut server, begun + Duration::from_secs_f64(exposed))?.is_some() {}
        if sent.send((number, Instant::now())).is_err() {
            break;
        }
        socket.send_to(&bytes, client)?;
    }
    Ok(())
}

/// Answers one datagram and says whose it was; `None` when none came until `end`.
fn answer(socket: &UdpSocket, server: &mut Server, end: Instant) -> Result<Option<SocketAddr>, TrackingError> {
    let left = end.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Ok(None);
    }
    socket.set_read_timeout(Some(left))?;
    let mut buffer = [0u8; 2048];
    let Ok((n, client)) = socket.recv_from(&mut buffer) else { return Ok(None) };
    if let Ok(Some(answer)) = server.receive(&buffer[..n], 0.0) {
        socket.send_to(&answer, client)?;
    }
    Ok(Some(client))
}
