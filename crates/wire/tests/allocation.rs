//! No decoder allocates from a number that the bytes present do not cover: every single-byte corruption of a valid message of
//! each kind is decoded under a counting allocator.

use monro_wire::natnet::{
    BodyPose, Client, ClientOptions, ConnectOptions, Frame, MessageId, Server, ServerInfo, ServerOptions, UpAxis,
    Version, definitions, split,
};
use monro_wire::openigtlink::{HEADER_SIZE, Message, crc64};
use monro_wire::recording::{Protocol, Recording, begin, record};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Bytes live and at most live in this thread since [`measured`] began.
struct Counting;

thread_local! {
    static LIVE: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    // A thread that is being torn down counts nothing.
    let _ = LIVE.try_with(|live| {
        live.set(live.get() + bytes);
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(live.get())));
    });
}

#[allow(unsafe_code, reason = "an allocator that counts can only be written so")]
// SAFETY: all calls go on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as for the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as for the caller.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most bytes that were live at a time while `work` ran.
fn measured(work: impl FnOnce()) -> usize {
    LIVE.set(0);
    PEAK.set(0);
    work();
    PEAK.get().max(0) as usize
}

/// Numbers of the wire become structures of at most so many times their size (a rigid body without markers: 34 bytes become
/// some 100, in a vector that doubles), and an error or an empty message takes some bytes of its own.
const TIMES: usize = 16;
const OWN: usize = 2048;

/// Decodes every single-byte corruption; `restore` puts a checksum right again.
fn survives(what: &str, bytes: &[u8], restore: impl Fn(&mut Vec<u8>), decode: impl Fn(&[u8])) {
    let mut corrupted = bytes.to_vec();
    for at in 0..bytes.len() {
        for flip in 1..=255u8 {
            corrupted[at] ^= flip;
            restore(&mut corrupted);
            let most = measured(|| decode(&corrupted));
            assert!(
                most <= TIMES * bytes.len() + OWN,
                "{what}: byte {at} ^ {flip:#x}: {most} bytes of {}",
                bytes.len()
            );
            corrupted.copy_from_slice(bytes);
        }
    }
}

const VERSIONS: [(u8, u8); 8] = [(2, 0), (2, 6), (2, 9), (3, 0), (3, 1), (4, 0), (4, 1), (4, 3)];

fn server(version: Version) -> Server {
    Server::new(ServerOptions {
        version,
        bodies: vec!["Stylus".to_owned(), "Reference".to_owned()],
        frequency: 10_000_000,
        data_port: 1511,
        multicast: true,
        up: UpAxis::Y,
        rate: 240.0,
    })
}

fn datagrams(version: Version) -> Vec<Vec<u8>> {
    let mut server = server(version);
    let asked = |id: MessageId| [id.number().to_le_bytes(), [0, 0]].concat();
    let poses: [BodyPose; 2] = [(None, 0.1), (None, 0.2)];
    let frame = server.frame(&poses, 1.0, 1.1);
    let model = server.receive(&asked(MessageId::RequestModelDefinition), 0.0).expect("ours").expect("answer");
    vec![frame, model, server.info().encode(), ConnectOptions::default().encode(MessageId::Connect)]
}

#[test]
fn corrupted_natnet_datagrams_take_no_memory_that_they_do_not_cover() {
    for (major, minor) in VERSIONS {
        let version = Version::new(major, minor);
        for datagram in datagrams(version) {
            let decode = |bytes: &[u8]| {
                let Ok((_, payload)) = split(bytes) else { return };
                drop((Frame::decode(payload, version), definitions(payload, version), ServerInfo::decode(payload)));
            };
            survives(&format!("NatNet {version}"), &datagram, |_| {}, decode);
        }
    }
}

#[test]
fn corrupted_datagrams_leave_a_client_that_goes_on() {
    for (major, minor) in VERSIONS {
        let version = Version::new(major, minor);
        let [frame, model, info, _] = datagrams(version).try_into().expect("four");
        for datagram in [&frame, &model, &info] {
            for at in 0..datagram.len() {
                let mut client = Client::new(ClientOptions::default());
                client.receive(&info, 0.0).expect("info");
                let mut corrupted = datagram.clone();
                corrupted[at] ^= 0xff;
                drop(client.receive(&corrupted, 0.1));
                client.receive(&info, 0.2).expect("info again");
                client.receive(&frame, 0.3).expect("a whole frame after a damaged datagram");
            }
        }
    }
}

#[test]
fn corrupted_messages_behind_a_valid_checksum_take_no_memory_that_they_do_not_cover() {
    let text = include_str!("vectors/openigtlink.hex");
    let mut kinds = 0;
    for (name, bytes) in vectors(text) {
        let restore = |bytes: &mut Vec<u8>| {
            let sum = crc64(&bytes[HEADER_SIZE..]);
            bytes[50..HEADER_SIZE].copy_from_slice(&sum.to_be_bytes());
        };
        survives(&name, &bytes, restore, |bytes| drop(Message::from_bytes(bytes)));
        kinds += 1;
    }
    assert!(kinds >= 13, "{kinds}");
}

#[test]
fn corrupted_recordings_take_no_memory_that_they_do_not_cover() {
    let mut file = begin(Protocol::NatNet, 7);
    (0..4u8).for_each(|i| file.extend(record(u64::from(i), &[i; 20]).expect("short")));
    survives("recording", &file, |_| {}, |bytes| drop(Recording::read(bytes)));
}

/// The named messages of a file: a name on a line of its own, its bytes in hexadecimal on the indented lines after it.
fn vectors(text: &str) -> Vec<(String, Vec<u8>)> {
    let mut out: Vec<(String, Vec<u8>)> = Vec::new();
    for line in text.lines().filter(|l| !l.starts_with('#') && !l.is_empty()) {
        match (line.strip_prefix("  "), out.last_mut()) {
            (Some(hex), Some((_, bytes))) => {
                let digits = |i: usize| u8::from_str_radix(&hex[i..i + 2], 16).expect("hex");
                bytes.extend((0..hex.len()).step_by(2).map(digits));
            }
            _ => out.push((line.to_owned(), Vec::new())),
        }
    }
    out
}
