//! A camera system that films the scripted hand and remembers when each frame left.

use super::display::Shown;
use anyhow::{Context, Result};
use monro_geometry::Point;
use monro_guidance::Plan;
use monro_session::live::Script;
use monro_wire::natnet::{Server, ServerOptions, UpAxis, Version};
use std::net::{SocketAddr, UdpSocket};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Mean marker error that is streamed, mm.
const MARKER_ERROR: f64 = 0.3;
/// How near a tip must be to where the script had it at a frame, mm: single precision in metres gives 0.0001.
const SAME_MM: f64 = 0.005;

/// The camera system, not yet filming.
#[derive(Debug)]
pub(crate) struct Camera {
    socket: UdpSocket,
    server: Server,
    script: Script,
    rate: f64,
}

impl Camera {
    pub(crate) fn open(plan: Plan, rate: f64) -> Result<Self> {
        let script = Script::new(plan);
        let bodies = script.observations(0.0).into_iter().map(|o| o.name).collect();
        let server = Server::new(ServerOptions {
            version: Version::new(4, 1),
            bodies,
            frequency: 10_000_000,
            data_port: 0,
            multicast: false,
            up: UpAxis::Z,
            rate: rate as f32,
        });
        Ok(Self { socket: UdpSocket::bind("127.0.0.1:0")?, server, script, rate })
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.socket.local_addr().unwrap_or_else(|e| unreachable!("a bound socket has an address: {e}"))
    }

    /// Films for so many seconds; gives when each frame left, by its number.
    pub(crate) fn film(mut self, seconds: f64) -> JoinHandle<Result<Vec<Instant>>> {
        thread::spawn(move || {
            let soon = Instant::now() + Duration::from_secs(5);
            let client = self.answer(soon)?.context("the server did not ask for poses")?;
            let (begun, mut departures) = (Instant::now(), Vec::new());
            for number in 0..(seconds * self.rate) as u32 {
                let exposed = f64::from(number) / self.rate;
                let poses: Vec<_> = self
                    .script
                    .observations(exposed)
                    .into_iter()
                    .map(|o| (o.tracker_from_tool, MARKER_ERROR))
                    .collect();
                let bytes = self.server.frame(&poses, exposed, exposed);
                while self.answer(begun + Duration::from_secs_f64(exposed))?.is_some() {}
                departures.push(Instant::now());
                self.socket.send_to(&bytes, client)?;
            }
            Ok(departures)
        })
    }

    /// Answers one datagram and says whose it was; `None` when none came until `end`.
    fn answer(&mut self, end: Instant) -> Result<Option<SocketAddr>> {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(None);
        }
        self.socket.set_read_timeout(Some(left))?;
        let mut buffer = [0u8; 2048];
        let Ok((n, client)) = self.socket.recv_from(&mut buffer) else { return Ok(None) };
        if let Ok(Some(answer)) = self.server.receive(&buffer[..n], 0.0) {
            self.socket.send_to(&answer, client)?;
        }
        Ok(Some(client))
    }
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
        let depth = (Point::from_array(tip.map(f64::from)) - plan.entry()).dot(plan.direction());
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
