//! A display: a WebSocket that asks for snapshots and reads of them what the bench needs (RFC 6455, the client's half).

use super::http::Door;
use anyhow::{Context, Result, bail};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// A masked text frame of four bytes, the mask being zero.
const ASK: [u8; 10] = [0x81, 0x84, 0, 0, 0, 0, b'n', b'e', b'x', b't'];
/// Largest message that a server may send, bytes.
const MOST_BYTES: u64 = 64 << 20;

/// What a snapshot showed, and when it had come.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shown {
    pub(crate) at: Instant,
    /// LPS, mm; `None` without a catheter.
    pub(crate) tip: Option<[f32; 3]>,
    pub(crate) step: u32,
    /// Whether the poses were lost.
    pub(crate) lost: bool,
}

/// A connected display.
#[derive(Debug)]
pub(crate) struct Display(TcpStream);

impl Display {
    pub(crate) fn open(door: &Door) -> Result<Self> {
        let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: bW9ucm8gYmVuY2ggbGl2ZQ==";
        let (mut stream, head) = door.send("GET", "/live", upgrade, "")?;
        if !head.starts_with("HTTP/1.1 101") {
            let mut why = String::new();
            let _ = stream.read_to_string(&mut why);
            bail!("the server refused a display: {head} {why}");
        }
        Ok(Self(stream))
    }

    /// Asks until the socket takes no more, and never reads.
    pub(crate) fn ask_forever(&self) -> Result<()> {
        let mut stream = &self.0;
        stream.set_nonblocking(true)?;
        // As many as fit into the socket, or plenty.
        for _ in 0..10_000 {
            if stream.write_all(&ASK).is_err() {
                break;
            }
        }
        Ok(())
    }

    /// Takes snapshots until `stop`, as fast as they come or at most `rate` a second.
    pub(crate) fn watch(mut self, rate: Option<f64>, stop: &AtomicBool) -> Result<Vec<Shown>> {
        let (mut all, mut due) = (Vec::new(), Instant::now());
        while !stop.load(Ordering::Relaxed) {
            if let Some(rate) = rate {
                thread::sleep(due.saturating_duration_since(Instant::now()));
                // A display that has missed a refresh waits for the next one.
                let period = Duration::from_secs_f64(1.0 / rate);
                while due <= Instant::now() {
                    due += period;
                }
            }
            self.0.write_all(&ASK)?;
            all.push(self.snapshot()?);
        }
        Ok(all)
    }

    fn snapshot(&mut self) -> Result<Shown> {
        loop {
            let mut head = [0; 2];
            self.0.read_exact(&mut head)?;
            let length = match head[1] & 127 {
                126 => u64::from(u16::from_be_bytes(self.array()?)),
                127 => u64::from_be_bytes(self.array()?),
                short => short.into(),
            };
            if length > MOST_BYTES {
                bail!("a message of {length} bytes");
            }
            let mut body = vec![0; length as usize];
            self.0.read_exact(&mut body)?;
            match head[0] & 15 {
                2 => return read(&body, Instant::now()).context("a snapshot is too short"),
                8 => bail!("the server closed the display"),
                _ => {}
            }
        }
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut out = [0; N];
        self.0.read_exact(&mut out)?;
        Ok(out)
    }
}

/// The layout is that of the server's snapshots.
fn read(body: &[u8], at: Instant) -> Option<Shown> {
    let word = |at: usize| body.get(at..at + 4).and_then(|b| b.try_into().ok());
    let float = |at: usize| word(at).map(f32::from_le_bytes);
    let tip = [float(16)?, float(20)?, float(24)?];
    Some(Shown {
        at,
        tip: (body.get(3)? & 1 == 1).then_some(tip),
        step: word(40).map(u32::from_le_bytes)?,
        lost: *body.get(2)? == 2,
    })
}
