//! Mutation fuzzing of every decoder: `cargo run --release -p monro-wire --example fuzz -- SECONDS [TARGET] [SEED]`.
//!
//! Each target starts from valid messages, changes some bytes (flips, cuts, doubled pieces, extreme counts), and reads the
//! result. A decoder must come back with a value or a named error; a panic ends the run and prints the input.

use monro_wire::natnet::{
    Client, ClientOptions, Frame, Server, ServerInfo, ServerOptions, UpAxis, Version, definitions,
};
use monro_wire::openigtlink::{HEADER_SIZE, Message, Parser, crc64, poses};
use monro_wire::recording::{Protocol, Recording, begin, record};
use std::error::Error;
use std::time::{Duration, Instant};

/// `SplitMix64`.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n.max(1) as u64) as usize
    }
}

/// Numbers that counts and sizes like to break on.
const EXTREMES: [u32; 8] = [0, 1, 0x7f, 0xff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff];

fn mutate(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(6) {
        let at = random.below(bytes.len());
        match random.below(6) {
            0 => bytes.truncate(at),
            1 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            2 if at < bytes.len() => bytes[at] = random.bits() as u8,
            3 if at + 4 <= bytes.len() => {
                let value = EXTREMES[random.below(EXTREMES.len())];
                let both = [value.to_le_bytes(), value.to_be_bytes()];
                bytes[at..at + 4].copy_from_slice(&both[random.below(2)]);
            }
            4 if bytes.len() < 4096 => {
                let piece = bytes[at..(at + random.below(64)).min(bytes.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            _ => {
                let end = (at + random.below(16)).min(bytes.len());
                bytes.drain(at..end);
            }
        }
    }
    bytes
}

fn vectors(file: &str) -> Vec<Vec<u8>> {
    let mut all: Vec<String> = Vec::new();
    for line in file.lines().filter(|l| !l.starts_with('#') && !l.is_empty()) {
        match (line.strip_prefix("  "), all.last_mut()) {
            (Some(hex), Some(last)) => last.push_str(hex),
            _ => all.push(String::new()),
        }
    }
    let byte = |hex: &str, i: usize| u8::from_str_radix(&hex[i..i + 2], 16).unwrap_or(0);
    all.iter().map(|hex| (0..hex.len()).step_by(2).map(|i| byte(hex, i)).collect()).collect()
}

const VERSIONS: [Version; 9] = [
    Version::new(2, 0),
    Version::new(2, 6),
    Version::new(2, 9),
    Version::new(2, 11),
    Version::new(3, 0),
    Version::new(4, 0),
    Version::new(4, 1),
    Version::new(4, 3),
    Version::new(4, 4),
];

fn server(version: Version) -> Server {
    Server::new(ServerOptions {
        version,
        bodies: vec!["Stylus".to_owned(), "Reference".to_owned()],
        frequency: 1_000_000,
        data_port: 1511,
        multicast: false,
        up: UpAxis::Y,
        rate: 120.0,
    })
}

fn read_message(bytes: &[u8], _: &mut Random) {
    let mut bytes = bytes.to_vec();
    if bytes.len() >= HEADER_SIZE {
        // Size and checksum are put right, so that the decoders behind them are reached.
        let (size, sum) = ((bytes.len() - HEADER_SIZE) as u64, crc64(&bytes[HEADER_SIZE..]));
        bytes[42..50].copy_from_slice(&size.to_be_bytes());
        bytes[50..58].copy_from_slice(&sum.to_be_bytes());
    }
    if let Ok(m) = Message::from_bytes(&bytes) {
        let _ = (poses(&m, 0.0), m.encode());
    }
}

fn read_stream(bytes: &[u8], random: &mut Random) {
    let (mut parser, mut rest) = (Parser::new(1 << 16), bytes);
    while !rest.is_empty() {
        let (piece, after) = rest.split_at(1 + random.below(rest.len()));
        parser.push(piece);
        while let Some(m) = parser.next_message() {
            if m.is_err() && parser.is_broken() {
                return;
            }
        }
        assert!(parser.pending() <= bytes.len());
        rest = after;
    }
}

fn read_frame(bytes: &[u8], random: &mut Random) {
    let version = VERSIONS[random.below(VERSIONS.len())];
    if let Ok(f) = Frame::decode(bytes.get(4..).unwrap_or_default(), version) {
        let _ = (f.encode(version), f.source_time(Some(1000)), f.system_latency(Some(1000)));
    }
}

fn read_conversation(bytes: &[u8], random: &mut Random) {
    let version = VERSIONS[random.below(VERSIONS.len())];
    let payload = bytes.get(4..).unwrap_or_default();
    let _ = (definitions(payload, version), ServerInfo::decode(payload), server(version).receive(bytes, 1.0));
    let forced = ClientOptions { force_version: Some(version), ..ClientOptions::default() };
    let mut client = Client::new(forced);
    let _ = client.receive(&server(version).info().encode(), 0.0);
    let _ = client.receive(bytes, 1.0);
    let _ = (client.poll(1.1), client.diagnosis(1.2, &["Stylus"]));
}

fn read_recording(bytes: &[u8], _: &mut Random) {
    if let Ok(r) = Recording::read(bytes) {
        assert!(r.records().iter().map(|x| x.bytes.len()).sum::<usize>() <= bytes.len());
    }
}

type Target = (&'static str, Vec<Vec<u8>>, fn(&[u8], &mut Random));

fn targets() -> Vec<Target> {
    let igtl = vectors(include_str!("../tests/vectors/openigtlink.hex"));
    let frames = vectors(include_str!("../tests/vectors/natnet.hex"));
    let mut talk = frames.clone();
    for version in VERSIONS {
        let mut s = server(version);
        talk.push(s.info().encode());
        talk.extend(
            [[4, 0, 0, 0].as_slice(), &[12, 0, 8, 0, 1, 2, 3, 4, 5, 6, 7, 8]]
                .iter()
                .filter_map(|q| s.receive(q, 1.0).ok()?),
        );
    }
    let records: Vec<u8> = frames.iter().flat_map(|f| record(7, f).unwrap_or_default()).collect();
    let recording = [begin(Protocol::NatNet, 1), records].concat();
    vec![
        ("openigtlink-message", igtl.clone(), read_message),
        ("openigtlink-stream", igtl.chunks(3).map(<[Vec<u8>]>::concat).collect(), read_stream),
        ("natnet-frame", frames, read_frame),
        ("natnet-conversation", talk, read_conversation),
        ("recording", vec![recording], read_recording),
    ]
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seconds: u64 = arguments.first().map_or(Ok(10), |a| a.parse())?;
    let only = arguments.get(1).filter(|a| *a != "all");
    let mut random = Random(arguments.get(2).map_or(Ok(1), |a| a.parse())?);
    for (name, seeds, read) in targets() {
        if only.is_some_and(|o| o != name) {
            continue;
        }
        let (begun, mut executions) = (Instant::now(), 0u64);
        while begun.elapsed() < Duration::from_secs(seconds) {
            for _ in 0..1000 {
                let input = mutate(&seeds[random.below(seeds.len())], &mut random);
                let survived = std::panic::catch_unwind(|| read(&input, &mut Random(executions)));
                if survived.is_err() {
                    let hex: String = input.iter().map(|b| format!("{b:02x}")).collect();
                    return Err(format!("{name} did not survive {hex}").into());
                }
                executions += 1;
            }
        }
        println!("{name}: {executions} executions in {seconds} s, clean");
    }
    Ok(())
}
