//! A camera system that films the scripted hand and remembers when each frame left.

use super::display::Shown;
use anyhow::{Context, Result};
use monro_geometry::Point;
use monro_guidance::Plan;
use monro_session::live::Script;
use monro_wire::natnet::{Server, ServerOptions, UpAxis, Version};
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Mean marker error that is streamed, mm.
const MARKER_ERROR: f64 = 0.3;
/// How long the server may take to ask for poses.
const PATIENCE: Duration = Duration::from_secs(5);
/// How near a tip must be to where the script had it at a frame, mm: single precision in metres gives 0.0001.
const SAME_MM: f64 = 0.005;

/// The camera system. It answers from the start, on a thread that ends with the program.
#[derive(Debug)]
pub(crate) struct Camera {
    socket: UdpSocket,
    server: Arc<Mutex<Server>>,
    /// Who has asked last.
    clients: Receiver<SocketAddr>,
    script: Script,
    rate: f64,
    /// When its clock, which stamps exposures and answers exchanges, was at 0.
    start: Instant,
}

impl Camera {
    pub(crate) fn open(plan: Plan, rate: f64) -> Result<Self> {
        let script = Script::new(plan);
        let bodies = script.observations(0.0).into_iter().map(|o| o.name).collect();
        let server = Arc::new(Mutex::new(Server::new(ServerOptions {
            version: Version::new(4, 1),
            bodies,
            frequency: 10_000_000,
            data_port: 0,
            multicast: false,
            up: UpAxis::Z,
            rate: rate as f32,
        })));
        let (socket, start) = (UdpSocket::bind("127.0.0.1:0")?, Instant::now());
        let (sender, clients) = channel();
        let (ear, answering) = (socket.try_clone()?, Arc::clone(&server));
        named().spawn(move || answer(&ear, &answering, start, &sender))?;
        Ok(Self { socket, server, clients, script, rate, start })
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.socket.local_addr().unwrap_or_else(|e| unreachable!("a bound socket has an address: {e}"))
    }

    /// Films for so many seconds; gives when each frame left, by its number.
    pub(crate) fn film(self, seconds: f64) -> io::Result<JoinHandle<Result<Vec<Instant>>>> {
        named().spawn(move || {
            let client = self.clients.recv_timeout(PATIENCE).context("the server did not ask for poses")?;
            let (begun, mut departures) = (Instant::now(), Vec::new());
            for number in 0..(seconds * self.rate) as u32 {
                let time = f64::from(number) / self.rate;
                let seen = self.script.observations(time);
                let poses: Vec<_> = seen.into_iter().map(|o| (o.tracker_from_tool, MARKER_ERROR)).collect();
                let due = begun + Duration::from_secs_f64(time);
                thread::sleep(due.saturating_duration_since(Instant::now()));
                let exposed = self.start.elapsed().as_secs_f64();
                let bytes = lock(&self.server).frame(&poses, exposed, exposed);
                departures.push(Instant::now());
                self.socket.send_to(&bytes, client)?;
            }
            Ok(departures)
        })
    }
}

fn named() -> thread::Builder {
    thread::Builder::new().name("bench-camera".into())
}

fn lock(server: &Mutex<Server>) -> MutexGuard<'_, Server> {
    server.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Answers what the client asks, and tells who it is.
fn answer(ear: &UdpSocket, server: &Mutex<Server>, start: Instant, clients: &Sender<SocketAddr>) {
    let mut buffer = [0u8; 2048];
    while let Ok((n, client)) = ear.recv_from(&mut buffer) {
        let answer = lock(server).receive(&buffer[..n], start.elapsed().as_secs_f64());
        let sent = answer.ok().flatten().map_or(Ok(0), |bytes| ear.send_to(&bytes, client));
        // Nobody listens any more once the film has ended.
        let _ = clients.send(client);
        if sent.is_err() {
            return;
        }
    }
}

/// Depth of a tip under the entry, along the plan, mm.
pub(crate) fn depth_mm(plan: &Plan, tip: [f32; 3]) -> f64 {
    (Point::from_array(tip.map(f64::from)) - plan.entry()).dot(plan.direction())
}

/// From each frame's departure to the first snapshot that shows it, s. The tip's depth tells the frame: the hand moves on
/// along the plan until it reaches the target.
pub(crate) fn latencies(plan: Plan, rate: f64, departures: &[Instant], shown: &[Shown]) -> Vec<f64> {
    let script = Script::new(plan);
    let mut depths: Vec<f64> = (0..departures.len()).map(|n| script.depth_mm(n as f64 / rate)).collect();
    let target = depths.iter().position(|d| *d >= plan.length() - 1e-6).unwrap_or(depths.len());
    depths.truncate(target);
    let mut first = vec![None; depths.len()];
    for s in shown {
        let Some(tip) = s.tip else { continue };
        let depth = depth_mm(&plan, tip);
        let next = depths.partition_point(|d| *d < depth);
        let nearest = [next.saturating_sub(1), next].into_iter().filter(|n| *n < depths.len());
        let nearest = nearest.min_by(|a, b| (depths[*a] - depth).abs().total_cmp(&(depths[*b] - depth).abs()));
        if let Some(n) = nearest.filter(|n| (depths[*n] - depth).abs() < SAME_MM) {
            first[n].get_or_insert(s.at);
        }
    }
    let took = |(at, left): (Option<Instant>, &Instant)| Some(at?.checked_duration_since(*left)?.as_secs_f64());
    first.into_iter().zip(departures).filter_map(took).collect()
}
