//! A peer that takes all that the server says over OpenIGTLink, as 3D Slicer would.

use anyhow::{Result, bail};
use monro_wire::openigtlink::Parser;
use std::io::{ErrorKind, Read};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Largest message, bytes: the CT comes once.
const MOST_BYTES: usize = 256 << 20;
/// How often it looks whether it shall stop.
const LOOK: Duration = Duration::from_millis(100);

/// Counts messages until `stop`.
///
/// # Errors
/// A server that cannot be reached; the thread's: one that hangs up, or talks nonsense.
pub(crate) fn watch(address: SocketAddr, stop: Arc<AtomicBool>) -> Result<JoinHandle<Result<u64>>> {
    let stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(LOOK))?;
    Ok(thread::Builder::new().name("bench-peer".into()).spawn(move || count(stream, &stop))?)
}

fn count(mut stream: TcpStream, stop: &AtomicBool) -> Result<u64> {
    let (mut parser, mut buffer, mut messages) = (Parser::new(MOST_BYTES), vec![0; 1 << 16], 0);
    while !stop.load(Ordering::Relaxed) {
        match stream.read(&mut buffer) {
            Ok(0) => bail!("the server hung up on the OpenIGTLink peer"),
            Ok(count) => parser.push(&buffer[..count]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(e) => return Err(e.into()),
        }
        while let Some(message) = parser.next_message() {
            message?;
            messages += 1;
        }
    }
    Ok(messages)
}
