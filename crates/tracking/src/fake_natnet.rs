//! A fake Motive: answers clients and streams a scene.

use crate::{Scene, TOOLS, TrackingError};
use monro_guidance::Random;
use monro_wire::natnet::{MULTICAST_GROUP, Server, ServerOptions, UpAxis, Version};
use socket2::SockRef;
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A client that has not been heard of for this long is forgotten.
const FORGET: Duration = Duration::from_secs(5);
/// Mean marker error that is streamed, mm.
const MARKER_ERROR: f64 = 0.3;

/// How a fake Motive streams.
#[derive(Debug, Clone, Copy)]
pub struct NatNetFake {
    /// Where it takes commands; port 0 for any.
    pub listen: SocketAddrV4,
    /// Port of the data.
    pub data_port: u16,
    /// To each client by itself instead of to the group.
    pub unicast: bool,
    /// Bitstream version.
    pub version: Version,
    /// Frames per second.
    pub rate: f64,
    /// Frames are late by up to this, s, at random.
    pub jitter: f64,
    /// Up-axis of the stream.
    pub up: UpAxis,
}

/// Runs until `stop` is set. `ready` is told the address on which commands are taken.
///
/// # Errors
/// When the socket cannot be opened.
pub fn run_fake_natnet(
    fake: &NatNetFake,
    scene: &mut Scene,
    stop: &AtomicBool,
    ready: impl FnOnce(SocketAddr),
) -> Result<(), TrackingError> {
    let refused = |address: String| move |error| TrackingError::Listen { address, error };
    let socket = UdpSocket::bind(fake.listen).map_err(refused(fake.listen.to_string()))?;
    let ip = *fake.listen.ip();
    if !fake.unicast && !ip.is_unspecified() {
        SockRef::from(&socket).set_multicast_if_v4(&ip).map_err(refused(format!("{ip} for a multicast group")))?;
    }
    ready(socket.local_addr()?);
    let mut motive = Motive::new(fake, socket);
    let mut random = Random::new(99);
    let mut frame = 0u64;
    while !stop.load(Ordering::Relaxed) {
        let exposed = frame as f64 / fake.rate;
        let late = fake.jitter * random.uniform();
        motive.serve_until(exposed + late, stop);
        motive.send(scene, exposed);
        frame += 1;
    }
    Ok(())
}

struct Motive {
    server: Server,
    socket: UdpSocket,
    begun: Instant,
    clients: BTreeMap<SocketAddr, Instant>,
    group: Option<SocketAddr>,
}

impl Motive {
    fn new(fake: &NatNetFake, socket: UdpSocket) -> Self {
        let options = ServerOptions {
            version: fake.version,
            bodies: TOOLS.map(str::to_owned).to_vec(),
            frequency: 10_000_000,
            data_port: fake.data_port,
            multicast: !fake.unicast,
            up: fake.up,
            rate: fake.rate as f32,
        };
        let group = SocketAddr::from((Ipv4Addr::from(MULTICAST_GROUP), fake.data_port));
        Self {
            server: Server::new(options),
            socket,
            begun: Instant::now(),
            clients: BTreeMap::new(),
            group: (!fake.unicast).then_some(group),
        }
    }

    fn now(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Answers clients until it is time for the next frame.
    fn serve_until(&mut self, due: f64, stop: &AtomicBool) {
        let mut buffer = [0u8; 2048];
        loop {
            let left = due - self.now();
            if left <= 0.0 || stop.load(Ordering::Relaxed) {
                return;
            }
            let wait = Duration::from_secs_f64(left.clamp(1e-4, 0.1));
            // A failed wait or answer loses one datagram, which clients send again.
            let _ = self.socket.set_read_timeout(Some(wait));
            let Ok((n, from)) = self.socket.recv_from(&mut buffer) else { continue };
            self.clients.insert(from, Instant::now());
            if let Ok(Some(answer)) = self.server.receive(&buffer[..n], self.now()) {
                let _ = self.socket.send_to(&answer, from);
            }
        }
    }

    fn send(&mut self, scene: &mut Scene, exposed: f64) {
        let poses: Vec<_> = scene.seen(exposed).into_iter().map(|p| (p, MARKER_ERROR)).collect();
        let bytes = self.server.frame(&poses, exposed, self.now().max(exposed));
        self.clients.retain(|_, heard| heard.elapsed() < FORGET);
        match self.group {
            Some(group) => drop(self.socket.send_to(&bytes, group)),
            None => self.clients.keys().for_each(|c| drop(self.socket.send_to(&bytes, c))),
        }
    }
}
