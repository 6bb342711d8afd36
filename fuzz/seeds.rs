//! Writes valid input for every target into `fuzz/corpus`, to begin with: `seeds FUZZ_FOLDER`.

use monro_session::live::log::{Entry, MAGIC, Opened, framed};
use monro_session::live::{Observation, PlainEvent, SessionEvent};
use monro_wire::natnet::{Server, ServerOptions, UpAxis, Version};
use monro_wire::recording::{Protocol, begin, record};
use std::error::Error;
use std::path::Path;

const VERSIONS: [[u8; 2]; 9] = [[2, 0], [2, 6], [2, 9], [2, 11], [3, 0], [4, 0], [4, 1], [4, 3], [4, 4]];

/// The messages of a file of test vectors: a heading, then lines of hexadecimal digits.
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

fn talk() -> Vec<Vec<u8>> {
    let mut all = vectors(include_str!("../crates/wire/tests/vectors/natnet.hex"));
    for [major, minor] in VERSIONS {
        let mut server = server(Version::new(major, minor));
        all.push(server.info().encode());
        let asked: [&[u8]; 2] = [&[4, 0, 0, 0], &[12, 0, 8, 0, 1, 2, 3, 4, 5, 6, 7, 8]];
        all.extend(asked.iter().filter_map(|q| server.receive(q, 1.0).ok()?));
        all.push(server.frame(&[(None, 0.0), (None, 0.0)], 1.0, 1.0));
    }
    all
}

/// The version before the bytes, as the targets of `NatNet` read it.
fn versioned(bytes: &[u8]) -> Vec<Vec<u8>> {
    VERSIONS.iter().map(|[major, minor]| [&[major - 2, *minor], bytes].concat()).collect()
}

fn session() -> Vec<u8> {
    let opened = Opened {
        generator: "monro".into(),
        case_dir: "/case".into(),
        identity: "tets.vtu=0".into(),
        settings: "paper".into(),
    };
    let seen = Observation { name: "Catheter".into(), time_s: 1.0, tracker_from_tool: None };
    let entries = [
        Entry::Opened(opened),
        Entry::Event(SessionEvent::Plain(PlainEvent::Started)),
        Entry::Seen(vec![seen]),
        Entry::Step { now_s: 1.0, dt_s: 0.02 },
        Entry::Taken { id: 1, time_s: 1.0, step: 1, sequence: 2 },
        Entry::Shown { id: 1, digest: 3 },
    ];
    entries.iter().fold(MAGIC.to_vec(), |file, e| [file, framed(&e.encode())].concat())
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: seeds FUZZ_FOLDER")?;
    let igtl = vectors(include_str!("../crates/wire/tests/vectors/openigtlink.hex"));
    let talk = talk();
    let frames = talk.iter().filter_map(|d| d.get(4..));
    let records: Vec<u8> = talk.iter().map(|d| record(7, d)).collect::<Result<Vec<_>, _>>()?.concat();
    let all: [(&str, Vec<Vec<u8>>); 6] = [
        ("openigtlink_message", igtl.clone()),
        ("openigtlink_stream", igtl.chunks(3).map(|c| [vec![40], c.concat()].concat()).collect()),
        ("natnet_frame", frames.flat_map(versioned).collect()),
        ("natnet_conversation", talk.iter().flat_map(|d| versioned(d)).collect()),
        ("recording", vec![[begin(Protocol::NatNet, 1), records].concat()]),
        ("session_log", vec![session()]),
    ];
    for (target, inputs) in all {
        let corpus = Path::new(&folder).join("corpus").join(target);
        std::fs::create_dir_all(&corpus)?;
        for (i, input) in inputs.iter().enumerate() {
            std::fs::write(corpus.join(format!("seed-{i}")), input)?;
        }
    }
    Ok(())
}
