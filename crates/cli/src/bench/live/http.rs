//! Just enough HTTP to talk to our own server.

use anyhow::{Context, Result, bail};
use monro_server::Ready;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// The server's address and the operator's token.
#[derive(Debug)]
pub(crate) struct Door {
    address: String,
    token: String,
}

impl Door {
    pub(crate) fn new(ready: &Ready) -> Result<Self> {
        let address = ready.url.strip_prefix("http://").context("the server is encrypted")?.to_owned();
        Ok(Self { address, token: ready.token.clone() })
    }

    /// Sends a request; gives the stream behind the head of the answer, and the head.
    pub(crate) fn send(&self, method: &str, path: &str, headers: &str, body: &str) -> Result<(TcpStream, String)> {
        let mut stream = TcpStream::connect(&self.address)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(Duration::from_secs(10)))?;
        let (address, token, length) = (&self.address, &self.token, body.len());
        let head = format!("{method} {path} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}");
        write!(stream, "{head}\r\n{headers}\r\nContent-Length: {length}\r\n\r\n{body}")?;
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte)?;
            head.push(byte[0]);
        }
        Ok((stream, String::from_utf8_lossy(&head).into_owned()))
    }

    fn ask(&self, method: &str, path: &str, body: &str) -> Result<Value> {
        let headers = "Connection: close\r\nContent-Type: application/json";
        let (mut stream, head) = self.send(method, path, headers, body)?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer)?;
        if !head.starts_with("HTTP/1.1 200") {
            bail!("{method} {path}: {answer}");
        }
        Ok(serde_json::from_str(&answer)?)
    }

    /// The answer to GET.
    pub(crate) fn get(&self, path: &str) -> Result<Value> {
        self.ask("GET", path, "")
    }

    /// The answer to POST.
    pub(crate) fn post(&self, path: &str, body: &str) -> Result<Value> {
        self.ask("POST", path, body)
    }
}
