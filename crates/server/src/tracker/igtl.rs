//! `igtl://`: poses of an OpenIGTLink server, connected again whenever it goes away.

use crate::live::Live;
use monro_session::live::Observation;
use monro_wire::openigtlink::{Parser, poses};
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::AsyncReadExt;
use tokio::net::TcpStream;

/// Tracking messages are small; a stream that announces more than this (images) is not for us.
const BODY_LIMIT: usize = 8 << 20;
/// Pause between two attempts to connect.
const RETRY: Duration = Duration::from_secs(1);

/// Connects and reads until the session stops. While there is no connection, poses grow old by themselves.
pub(crate) async fn run(live: Arc<Live>, host: String) {
    while !live.is_stopping() {
        if let Err(error) = read(&live, &host).await {
            eprintln!("tracker igtl://{host}: {error}; trying again");
        }
        tokio::time::sleep(RETRY).await;
    }
}

async fn read(live: &Live, host: &str) -> io::Result<()> {
    let mut stream = TcpStream::connect(host).await?;
    stream.set_nodelay(true)?;
    let mut parser = Parser::new(BODY_LIMIT);
    let mut buffer = vec![0; 1 << 16];
    while !live.is_stopping() {
        let count = stream.read(&mut buffer).await?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        parser.push(&buffer[..count]);
        let arrival = live.clock.now();
        while let Some(message) = parser.next_message() {
            match message {
                Ok(m) => live.observe(&poses(&m, arrival).into_iter().map(observation).collect::<Vec<_>>()),
                Err(error) if parser.is_broken() => return Err(io::Error::other(error)),
                // One damaged message; the next one is on its way.
                Err(_) => {}
            }
        }
    }
    Ok(())
}

fn observation(pose: monro_wire::TimedPose) -> Observation {
    Observation { name: pose.name, time_s: pose.arrival_time, tracker_from_tool: pose.tracker_from_tool }
}
