//! How long a pose takes from the datagram's departure to our hands, on the loopback interface.

use super::{Clock, Scene, SceneOptions, Source, TOOLS, natnet::NatNetSource};
use anyhow::{Result, anyhow};
use monro_wire::natnet::{Server, ServerOptions, UpAxis, Version};
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

/// Sends `frames` frames at `rate` Hz to a client of our own and returns how long each took to become poses, s.
///
/// # Errors
/// When the loopback interface does not carry datagrams.
pub fn latencies(frames: u32, rate: f64) -> Result<Vec<f64>> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    let url = format!("natnet://{}?unicast=1", socket.local_addr()?).parse()?;
    let super::TrackerUrl::NatNet(address) = url else { return Err(anyhow!("not a NatNet address")) };
    let (sender, sent) = channel();
    let server = std::thread::spawn(move || send(&socket, frames, rate, &sender));
    let mut source = NatNetSource::open(&address, Clock::new(), None)?;
    let mut all = Vec::new();
    loop {
        let batch = source.next(Duration::from_secs(3))?.unwrap_or_default();
        let taken = Instant::now();
        let Some(time) = batch.poses.first().and_then(|p| p.source_time) else { break };
        // The exposure time of frame n is n / rate: it finds the moment of its departure.
        let number = (time * rate).round() as u32;
        let departure = sent.iter().find(|(n, _): &(u32, Instant)| *n >= number);
        all.extend(departure.filter(|(n, _)| *n == number).map(|(_, at)| taken.duration_since(at).as_secs_f64()));
        if number >= frames {
            break;
        }
    }
    server.join().map_err(|_| anyhow!("the sending thread failed"))??;
    Ok(all)
}

fn send(socket: &UdpSocket, frames: u32, rate: f64, sent: &Sender<(u32, Instant)>) -> Result<()> {
    let mut server = Server::new(ServerOptions {
        version: Version::new(4, 1),
        bodies: TOOLS.map(str::to_owned).to_vec(),
        frequency: 10_000_000,
        data_port: 0,
        multicast: false,
        up: UpAxis::Z,
        rate: rate as f32,
    });
    let (mut scene, mut buffer) = (Scene::new(SceneOptions::default()), [0u8; 2048]);
    socket.set_read_timeout(Some(Duration::from_secs(3)))?;
    let (n, client) = socket.recv_from(&mut buffer)?;
    if let Some(answer) = server.receive(&buffer[..n], 0.0)? {
        socket.send_to(&answer, client)?;
    }
    let begun = Instant::now();
    for number in 1..=frames {
        let exposed = f64::from(number) / rate;
        let poses: Vec<_> = scene.seen(exposed).into_iter().map(|p| (p, 0.3)).collect();
        let bytes = server.frame(&poses, exposed, exposed);
        std::thread::sleep(Duration::from_secs_f64(exposed).saturating_sub(begun.elapsed()));
        sent.send((number, Instant::now())).map_err(|_| anyhow!("nobody listens any more"))?;
        socket.send_to(&bytes, client)?;
    }
    Ok(())
}
