//! Spec vectors, truncations, corruptions, and a client that talks to the fake Motive in every version.

use super::*;
use crate::{Missing, Quality, TimedPose};
use monro_geometry::{Rigid, Tool, Tracker, Vector};
use proptest::prelude::*;

const VERSIONS: [Version; 12] = [
    Version::new(2, 0),
    Version::new(2, 1),
    Version::new(2, 3),
    Version::new(2, 6),
    Version::new(2, 9),
    Version::new(2, 11),
    Version::new(3, 0),
    Version::new(3, 1),
    Version::new(4, 0),
    Version::new(4, 1),
    Version::new(4, 2),
    Version::new(4, 3),
];

const VECTORS: [(&str, Version); 7] = [
    ("captured_3_0", Version::new(3, 0)),
    ("synthetic_2_6", Version::new(2, 6)),
    ("synthetic_2_9", Version::new(2, 9)),
    ("synthetic_3_0", Version::new(3, 0)),
    ("synthetic_3_0", Version::new(3, 1)),
    ("synthetic_3_0", Version::new(4, 0)),
    ("synthetic_4_1", Version::new(4, 1)),
];

fn vector(name: &str) -> Vec<u8> {
    crate::bytes::vectors::named(include_str!("../../tests/vectors/natnet.hex"), name)
}

fn read(name: &str, version: Version) -> Frame {
    let bytes = vector(name);
    let (header, payload) = split(&bytes).expect("header");
    assert_eq!((header.id, usize::from(header.declared)), (MessageId::Frame, payload.len()));
    Frame::decode(payload, version).unwrap_or_else(|e| panic!("{name} {version}: {e}"))
}

#[test]
fn every_vector_is_read_without_oddities_and_written_back_to_the_same_bytes() {
    for (name, version) in VECTORS {
        let frame = read(name, version);
        assert_eq!(frame.faults, []);
        assert_eq!(frame.encode(version), vector(name), "{name} {version}");
    }
}

#[test]
fn the_captured_frame_holds_the_numbers_of_the_specification() {
    let f = read("captured_3_0", Version::new(3, 0));
    assert_eq!((f.number, f.other_markers.len(), f.labeled_markers.len()), (162_734, 5, 6));
    let b = &f.rigid_bodies[0];
    assert_eq!((b.id, b.params, b.is_tracked()), (2, Some(1), true));
    let near = |a: f32, b: f32| (a - b).abs() < 5e-7;
    assert!(near(b.position[0], 0.174447) && near(b.quaternion_xyzw[3], -0.857358) && near(b.error, 0.000515220));
    let m = &f.labeled_markers[0];
    assert_eq!((m.id, m.params), (0x0002_0001, 0x0a));
    assert!(near(m.size, 0.021440) && near(m.residual, 0.000207483));
    assert!((f.suffix.timestamp - 1_356.116_667).abs() < 1e-6);
    assert_eq!((f.suffix.mid_exposure, f.suffix.transmitted), (1_416_497_730_518, 1_416_497_748_722));
    let latency = f.system_latency(Some(3_312_787)).expect("ticks");
    assert!((latency - 0.005_495).abs() < 1e-6, "{latency}");
}

#[test]
fn the_old_synthetic_frame_holds_its_markers_one_array_after_the_other() {
    let f = read("synthetic_2_6", Version::new(2, 6));
    let b = &f.rigid_bodies[0];
    assert_eq!((b.markers[0].id, b.markers[1].id), (1, 2));
    assert_eq!((b.markers[0].size, b.markers[1].position), (0.014, [0.4, 0.5, 0.6]));
    assert_eq!((f.suffix.latency, f.suffix.timestamp, f.models_changed()), (0.0055, 12.5, true));
    assert_eq!(f.marker_sets[0].name, "Stylus");
}

#[test]
fn the_captured_server_info_is_read_and_rubbish_after_the_name_is_ignored() {
    let mut payload = vec![0u8; 256];
    payload[..7].copy_from_slice(b"Motive\0");
    payload[7..20].copy_from_slice(b"old rubbish!!");
    payload.extend_from_slice(&[2, 1, 0, 0, 3, 0, 0, 0, 0x93, 0x8c, 0x32, 0, 0, 0, 0, 0, 0xe7, 5, 1, 239, 255, 42, 99]);
    let info = ServerInfo::decode(&payload).expect("whole");
    assert_eq!((info.sender.name.as_str(), info.sender.version()), ("Motive", Version::new(3, 0)));
    let clock = Clock { frequency: 3_312_787, data_port: 1511, multicast: true, group: [239, 255, 42, 99] };
    assert_eq!(info.clock, Some(clock));
    for end in 0..payload.len() {
        assert!(matches!(ServerInfo::decode(&payload[..end]), Err(NatNetError::Read { .. })), "{end}");
    }
}

#[test]
fn every_truncation_of_a_frame_is_refused_by_name() {
    for (name, version) in VECTORS {
        let bytes = vector(name);
        for end in 4..bytes.len() {
            let e = Frame::decode(&bytes[4..end], version).expect_err(name);
            let named = matches!(e, NatNetError::Read { .. } | NatNetError::Section { .. });
            assert!(named, "{name} {version} {end}: {e}");
        }
        assert!((0..4).all(|n| split(&bytes[..n]) == Err(NatNetError::NoHeader(n))));
    }
}

/// Bytes that the decoded frame holds on the heap stay within a small multiple of the datagram.
fn held(f: &Frame) -> usize {
    let set = |s: &MarkerSet| size_of::<MarkerSet>() + s.name.len() + 12 * s.markers.len();
    let body = |b: &RigidBody| size_of::<RigidBody>() + size_of::<BodyMarker>() * b.markers.len();
    let channels = |d: &ChannelData| {
        size_of::<ChannelData>() + d.channels.iter().map(|c| size_of::<Vec<f32>>() + 4 * c.len()).sum::<usize>()
    };
    f.marker_sets.iter().map(set).sum::<usize>()
        + 12 * f.other_markers.len()
        + f.rigid_bodies.iter().map(body).sum::<usize>()
        + f.skeletons.iter().flat_map(|s| &s.bones).map(body).sum::<usize>()
        + size_of::<LabeledMarker>() * f.labeled_markers.len()
        + f.force_plates.iter().chain(&f.devices).map(channels).sum::<usize>()
}

#[test]
fn every_corruption_of_a_frame_is_survived_within_its_size() {
    for (name, version) in VECTORS {
        let mut bytes = vector(name);
        for at in 4..bytes.len() {
            for flip in 1..=255 {
                bytes[at] ^= flip;
                if let Ok(f) = Frame::decode(&bytes[4..], version) {
                    assert!(held(&f) <= 16 * bytes.len(), "{name} {at} {flip}");
                }
                bytes[at] ^= flip;
            }
        }
    }
}

#[test]
fn a_frame_read_with_the_wrong_version_is_refused_not_believed() {
    for (name, version) in [("synthetic_3_0", Version::new(4, 1)), ("synthetic_4_1", Version::new(3, 0))] {
        let e = Frame::decode(&vector(name)[4..], version).expect_err(name);
        assert!(e.to_string().contains("version") || matches!(e, NatNetError::Section { .. }), "{e}");
    }
    assert!(Frame::decode(&vector("synthetic_3_0")[4..], Version::new(2, 9)).is_err());
    assert_eq!(Frame::decode(&[], Version::new(1, 9)), Err(NatNetError::TooOld(Version::new(1, 9))));
}

#[test]
fn a_newer_version_is_read_by_its_sizes_and_marked() {
    let mut bytes = vector("synthetic_4_1");
    let end = bytes.len() - 6;
    bytes.splice(end..end, [1, 2, 3, 4, 5, 6, 7, 8]);
    // A labeled marker section with four more bytes than known: size 26 becomes 30.
    let at = bytes.windows(8).position(|w| w == [1, 0, 0, 0, 26, 0, 0, 0]).expect("section");
    bytes[at + 4] = 30;
    bytes.splice(at + 34..at + 34, [9, 9, 9, 9]);
    let f = Frame::decode(&bytes[4..], Version::new(4, 4)).expect("sizes lead");
    let odd = [Fault::SectionEnd { section: "labeled markers", unread: 4 }, Fault::Extra(8)];
    assert_eq!(f.faults, odd);
    assert_eq!(f.rigid_bodies, read("synthetic_4_1", Version::new(4, 1)).rigid_bodies);
    assert!(matches!(Frame::decode(&bytes[4..], Version::new(4, 3)), Err(NatNetError::End { .. })));
}

fn pose(t: [f64; 3]) -> Rigid<Tracker, Tool> {
    Rigid::from_axis_angle(Vector::new(1.0, 2.0, 3.0), 0.7, Vector::from_array(t)).expect("axis")
}

fn server(version: Version, up: UpAxis) -> Server {
    Server::new(ServerOptions {
        version,
        bodies: vec!["Stylus".to_owned(), "Reference".to_owned()],
        frequency: 10_000_000,
        data_port: 1511,
        multicast: false,
        up,
        rate: 240.0,
    })
}

/// Lets the client ask and the server answer, until neither has anything to say.
fn talk(client: &mut Client, server: &mut Server, now: f64) -> Vec<Event> {
    let mut events = Vec::new();
    for _ in 0..4 {
        for question in client.poll(now) {
            if let Some(answer) = server.receive(&question, now + 100.0).expect("our own question") {
                events.extend(client.receive(&answer, now).expect("our own answer"));
            }
        }
    }
    events
}

fn poses_of(event: Option<Event>) -> Vec<TimedPose> {
    let Some(Event::Frame(_, poses)) = event else { panic!("{event:?}") };
    poses
}

#[test]
fn a_client_follows_the_fake_motive_in_every_version_and_with_either_axis_up() {
    for version in VERSIONS {
        for up in [UpAxis::Y, UpAxis::Z] {
            let mut server = server(version, up);
            let mut client = Client::new(ClientOptions { up, ..ClientOptions::default() });
            let events = talk(&mut client, &mut server, 5.0);
            assert!(events.iter().any(|e| matches!(e, Event::Models(_))), "{version}");
            assert_eq!(events.iter().any(|e| matches!(e, Event::Echo(_))), version.since(3, 0), "{version}");
            let truth = pose([100.0, -200.0, 300.0]);
            let bytes = server.frame(&[(Some(truth), 0.12), (None, 0.0)], 104.9, 105.0);
            let poses = poses_of(client.receive(&bytes, 5.0).expect("our own frame"));
            let found = poses[0].tracker_from_tool.expect("tracked");
            assert!((found.translation() - truth.translation()).norm() < 1e-4, "{version} {up:?}");
            assert!(found.inverse().after(&truth).angle() < 1e-6, "{version} {up:?}");
            assert_eq!((poses[0].name.as_str(), poses[1].name.as_str()), ("Stylus", "Reference"));
            assert_eq!(poses[1].quality, Quality::Missing(Missing::NotTracked));
            let expected = version.since(3, 0).then_some(104.9);
            assert!(poses[0].source_time.zip(expected).is_none_or(|(a, b)| (a - b).abs() < 1e-6));
            assert_eq!(poses[0].source_time.is_some(), expected.is_some());
        }
    }
}

#[test]
fn y_up_becomes_z_up_in_millimetres() {
    let p = UpAxis::Y.pose([0.1, 0.2, 0.3], [0.0, 0.0, 0.0, 1.0]).expect("pose");
    assert!((p.translation() - Vector::new(100.0, -300.0, 200.0)).norm() < 1e-4);
    assert!((p.vector(Vector::new(0.0, 1.0, 0.0)) - Vector::new(0.0, 0.0, 1.0)).norm() < 1e-12);
}

#[test]
fn the_echo_carries_both_clocks() {
    let (mut server, mut client) = (server(Version::new(3, 0), UpAxis::Y), Client::new(ClientOptions::default()));
    let events = talk(&mut client, &mut server, 5.0);
    let echo = events.iter().find_map(|e| if let Event::Echo(x) = e { Some(*x) } else { None }).expect("echo");
    assert!((echo.sent - 5.0).abs() < 1e-8 && (echo.server - 105.0).abs() < 1e-6 && echo.received == 5.0);
}

#[test]
fn frames_before_the_server_is_known_are_refused_unless_the_version_is_forced() {
    let bytes = vector("captured_3_0");
    let mut client = Client::new(ClientOptions::default());
    assert_eq!(client.receive(&bytes, 0.0), Err(NatNetError::NoVersion));
    assert_eq!(client.counters().malformed, 1);
    let forced = ClientOptions { force_version: Some(Version::new(3, 0)), ..ClientOptions::default() };
    let poses = poses_of(Client::new(forced).receive(&bytes, 0.0).expect("forced"));
    assert_eq!((poses[0].name.as_str(), poses[0].tracker_from_tool.is_some()), ("#2", true));
}

/// It said that the server gave no answer, with its frames coming in; they were refused until it had introduced itself again.
#[test]
fn frames_go_on_after_the_server_dropped_a_client_and_it_is_asked_to_take_it_up_again() {
    let (mut server, mut client) = (server(Version::new(4, 1), UpAxis::Y), Client::new(ClientOptions::default()));
    talk(&mut client, &mut server, 0.0);
    let dropped = [11u16.to_le_bytes(), 0u16.to_le_bytes()].concat();
    assert_eq!(client.receive(&dropped, 2.0), Ok(Some(Event::Dropped)));
    let frame = server.frame(&[(Some(pose([0.0; 3])), 0.1)], 2.0, 2.0);
    assert_eq!(poses_of(client.receive(&frame, 2.0).expect("frame"))[0].name, "Stylus");
    assert!(client.diagnosis(2.1, &["Stylus"]).is_well(), "{}", client.diagnosis(2.1, &["Stylus"]));
    assert!(client.poll(2.1).iter().any(|q| q[..2] == [0, 0]), "CONNECT");
    talk(&mut client, &mut server, 3.2);
    client.receive(&server.frame(&[], 4.4, 4.4), 4.4).expect("frame");
    assert!(client.poll(4.5).iter().all(|q| q[..2] != [0, 0]), "it has answered");
}

#[test]
fn after_bodies_changed_poses_had_the_old_names_until_the_new_ones_came() {
    let (mut server, mut client) = (server(Version::new(4, 1), UpAxis::Y), Client::new(ClientOptions::default()));
    talk(&mut client, &mut server, 0.0);
    server.rename(vec!["Catheter".to_owned(), "Reference".to_owned()]);
    let frame = server.frame(&[(Some(pose([0.0; 3])), 0.1)], 0.0, 0.0);
    let nobody = |name: &str| assert!(name.starts_with('#'), "{name}");
    nobody(&poses_of(client.receive(&frame, 0.1).expect("frame"))[0].name);
    // The question is asked at once, and soon again if the answer is lost.
    assert!(!client.poll(0.1).is_empty() && client.poll(0.2).is_empty());
    let frame = server.frame(&[(Some(pose([0.0; 3])), 0.1)], 0.2, 0.2);
    nobody(&poses_of(client.receive(&frame, 0.2).expect("frame"))[0].name);
    talk(&mut client, &mut server, 0.4);
    // Some servers go on saying it.
    server.rename(vec!["Catheter".to_owned(), "Reference".to_owned()]);
    let frame = server.frame(&[(Some(pose([0.0; 3])), 0.1)], 0.0, 0.0);
    assert_eq!(poses_of(client.receive(&frame, 2.1).expect("frame"))[0].name, "Catheter");
}

#[test]
fn an_older_bitstream_can_be_asked_of_a_unicast_server() {
    let mut server = server(Version::new(4, 3), UpAxis::Y);
    let wish = ClientOptions { bitstream: Some(Version::new(4, 1)), ..ClientOptions::default() };
    let mut client = Client::new(wish);
    talk(&mut client, &mut server, 0.0);
    assert_eq!((client.version(), server.version()), (Some(Version::new(4, 1)), Version::new(4, 1)));
}

#[test]
fn the_connect_datagrams_are_those_of_the_specification() {
    assert_eq!(ConnectOptions::default().encode(MessageId::Connect), [0, 0, 0, 0]);
    let sender = Sender { name: "NatNetLib".to_owned(), application: [0; 4], natnet: [3, 0, 0, 0] };
    let plain = ConnectOptions { sender: Some(sender.clone()), bitstream: None }.encode(MessageId::Connect);
    assert_eq!((plain.len(), &plain[..8]), (268, [0, 0, 8, 1, 0x4e, 0x61, 0x74, 0x4e].as_slice()));
    let asking = ConnectOptions { sender: Some(sender), bitstream: Some(Version::new(4, 1)) };
    let bytes = asking.encode(MessageId::Connect);
    assert_eq!(
        (bytes.len(), &bytes[..4], &bytes[268..]),
        (274, [0, 0, 14, 1].as_slice(), [0, 4, 1, 0, 0, 0].as_slice())
    );
    assert_eq!(ConnectOptions::decode(&bytes[4..]), asking);
}

#[test]
fn answers_are_read_by_what_was_asked() {
    let (mut server, mut client) = (server(Version::new(4, 1), UpAxis::Y), Client::new(ClientOptions::default()));
    let mut ask = |text: &str| {
        let question = client.request(text);
        let answer = server.receive(&question, 0.0).expect("question").expect("answer");
        client.receive(&answer, 0.0).expect("answer").expect("event")
    };
    assert_eq!(ask("FrameRate"), Event::Response(Response::Float(240.0)));
    assert_eq!(ask("CurrentMode"), Event::Response(Response::Integer(0)));
    assert_eq!(ask("Bitstream"), Event::Response(Response::Text("Bitstream,4.1".to_owned())));
    assert_eq!(ask("Bitstream,3.1"), Event::Response(Response::Status(0)));
    assert_eq!(ask("FlyToTheMoon"), Event::Response(Response::Status(-1)));
    assert_eq!(Response::decode(b"true", Pending::Text), Response::Text("true".to_owned()));
}

#[test]
fn model_definitions_round_trip_and_survive_truncation_and_corruption() {
    let marker = |name: &str, x| MarkerDefinition { name: name.to_owned(), offset: [x, 0.0, 0.1], active_label: 0 };
    let body = RigidBodyDefinition {
        name: "RaceQuad".to_owned(),
        id: 2,
        parent: -1,
        offset: [0.0; 3],
        rotation_xyzw: [0.0, 0.0, 0.0, 1.0],
        markers: vec![marker("a", 0.1), marker("b", 0.2)],
    };
    let all = [
        Definition::RigidBody(body.clone()),
        Definition::MarkerSet { name: "all".to_owned(), markers: vec!["m1".to_owned(), "m2".to_owned()] },
        Definition::Skeleton { name: "Hand".to_owned(), id: 3, bones: vec![body] },
        Definition::Camera {
            name: "Prime 13".to_owned(),
            position: [1.0, 2.0, 3.0],
            quaternion_xyzw: [0.0, 0.0, 0.0, 1.0],
        },
    ];
    for v in [Version::new(4, 0), Version::new(4, 1), Version::new(4, 2)] {
        let mut bytes = model::encode(&all, v);
        assert_eq!(definitions(&bytes[4..], v).as_deref(), Ok(all.as_slice()), "{v}");
        assert!((4..bytes.len()).all(|end| definitions(&bytes[4..end], v).is_err()), "{v}");
        for at in 4..bytes.len() {
            for flip in [1, 2, 0x40, 0x80, 0xff] {
                bytes[at] ^= flip;
                let _ = definitions(&bytes[4..], v);
                bytes[at] ^= flip;
            }
        }
    }
}

#[test]
fn unknown_definitions_are_skipped_by_size_or_end_the_reading() {
    let all = [Definition::Other(77), Definition::MarkerSet { name: "all".to_owned(), markers: vec![] }];
    let sized = model::encode(&all, Version::new(4, 1));
    assert_eq!(definitions(&sized[4..], Version::new(4, 1)).map(|d| d.len()), Ok(2));
    let unsized_ = model::encode(&all, Version::new(3, 0));
    assert_eq!(definitions(&unsized_[4..], Version::new(3, 0)), Ok(vec![Definition::Other(77)]));
}

#[test]
fn the_diagnosis_names_the_first_cause() {
    let mut client = Client::new(ClientOptions::default());
    client.poll(0.0);
    assert_eq!(client.diagnosis(3.0, &[]), Diagnosis::NoServer { waited: 3.0 });
    let mut server = server(Version::new(3, 0), UpAxis::Y);
    talk(&mut client, &mut server, 3.0);
    let d = client.diagnosis(6.0, &["Stylus"]);
    assert!(matches!(d, Diagnosis::NoData { multicast: Some(false), .. }) && d.to_string().contains("unicast"), "{d}");
    let frame = server.frame(&[(Some(pose([0.0; 3])), 0.1), (None, 0.0)], 0.0, 0.0);
    client.receive(&frame, 6.0).expect("frame");
    assert_eq!(client.diagnosis(6.1, &["Stylus"]), Diagnosis::Streaming(Version::new(3, 0)));
    assert_eq!(client.diagnosis(6.1, &["Reference"]), Diagnosis::NotTracked { name: "Reference".to_owned() });
    assert!(client.diagnosis(6.1, &["Glasses"]).to_string().contains("streamed: Stylus, Reference"));
    assert!(matches!(client.diagnosis(9.0, &[]), Diagnosis::Stopped { .. }));
}

/// The client after frames with these numbers, and how many poses each gave.
fn after(numbers: &[i32]) -> (Client, Vec<usize>) {
    after_exposed(&numbers.iter().map(|&n| (n, 0)).collect::<Vec<_>>())
}

/// The same with the times of their exposure.
fn after_exposed(frames: &[(i32, u64)]) -> (Client, Vec<usize>) {
    let version = Version::new(3, 0);
    let mut client = Client::new(ClientOptions { force_version: Some(version), ..ClientOptions::default() });
    let poses = frames.iter().map(|&(number, mid_exposure)| {
        let suffix = Suffix { mid_exposure, ..Suffix::default() };
        let body = RigidBody { id: number, ..RigidBody::default() };
        let bytes = Frame { number, rigid_bodies: vec![body], suffix, ..Frame::default() }.encode(version);
        match client.receive(&bytes, 0.0).expect("frame") {
            Some(Event::Frame(_, poses)) => poses.len(),
            other => panic!("{other:?}"),
        }
    });
    let poses = poses.collect();
    (client, poses)
}

#[test]
fn gaps_and_restarts_are_counted() {
    let (client, _) = after(&[510, 511, 515, 3, 4]);
    let c = client.counters();
    assert_eq!((c.frames, c.missed, c.restarts, c.malformed), (5, 3, 1, 0));
}

/// Where the server's clock is not known a frame that was overtaken on its way was shown as the newest.
#[test]
fn frames_that_come_late_have_no_poses_and_numbers_that_begin_anew_do() {
    let (client, poses) = after(&[10, 12, 11, 13, 13, 14]);
    assert_eq!(poses, [1, 1, 0, 1, 0, 1]);
    assert_eq!((client.counters().restarts, client.counters().missed), (0, 1));
    // Nor did they say what is streamed now.
    let (client, _) = after(&[10, 12, 11]);
    assert_eq!(client.seen.keys().collect::<Vec<_>>(), [&12]);
    // A short take that loops: it takes a moment to see that these are no late ones.
    let (client, poses) = after(&[50, 0, 1, 2, 3, 4, 5]);
    assert_eq!((poses, client.counters().restarts), (vec![1, 0, 0, 0, 0, 1, 1], 1));
}

/// Four frames of each turn of a loop were lost, and four of five of a server that does not count them.
#[test]
fn frames_exposed_after_the_last_one_are_new_whatever_their_number() {
    let (client, poses) = after_exposed(&[(50, 900), (51, 910), (0, 920), (1, 930), (2, 940)]);
    assert_eq!((poses, client.counters().restarts), (vec![1, 1, 1, 1, 1], 1));
    let (client, poses) = after_exposed(&[(7, 10), (7, 20), (7, 20), (7, 15), (7, 30), (7, 40)]);
    assert_eq!((poses, client.counters().restarts), (vec![1, 1, 0, 0, 1, 1], 0));
    // A frame overtaken on its way is older by both.
    let (_, poses) = after_exposed(&[(10, 100), (12, 120), (11, 110), (13, 130)]);
    assert_eq!(poses, [1, 1, 0, 1]);
    // A server that was started anew counts exposures anew, too.
    let (client, poses) = after_exposed(&[(500, 9000), (1, 10), (2, 20), (3, 30)]);
    assert_eq!((poses, client.counters().restarts), (vec![1, 1, 1, 1], 1));
}

/// One datagram over and over was live with an age of nothing where the server's clock is not known.
#[test]
fn a_frame_that_is_sent_again_and_again_was_live() {
    for (version, counts) in [((2, 9), false), ((2, 9), true), ((3, 0), false), ((4, 1), true)] {
        let version = Version::new(version.0, version.1);
        let (mut client, mut server) = (Client::new(ClientOptions::default()), server(version, UpAxis::Y));
        talk(&mut client, &mut server, 0.0);
        let seen = |time: f64| [(Some(pose([time, 0.0, 0.0])), 0.1), (None, 0.0)];
        let mut told = |now: f64, bytes: &[u8]| {
            let poses = poses_of(client.receive(bytes, now).expect("frame")).len();
            (poses, client.diagnosis(now, &["Stylus"]).to_string())
        };
        let first = server.frame(&seen(1.0), 1.0, 1.0);
        assert_eq!(told(1.0, &first).0, 2, "{version}");
        let repeats = (1..100).map(|i| {
            let again = server.frame(&seen(1.0), 1.0, 1.0);
            told(1.0 + f64::from(i) / 60.0, if counts { &again } else { &first })
        });
        let repeats: Vec<_> = repeats.collect();
        assert!(repeats.iter().all(|r| r.0 == 0), "{version}: {repeats:?}");
        assert!(repeats[98].1.contains("one and the same frame has been sent for 1.6"), "{version}: {}", repeats[98].1);
        let next = server.frame(&seen(2.7), 2.7, 2.7);
        assert_eq!(told(2.7, &next).0, 2, "{version}");
        // What comes in its place cannot be read; that "data stopped" was told.
        assert!(client.receive(&next[..next.len() / 2], 3.9).is_err());
        let words = [4.0, 5.0].map(|now| client.diagnosis(now, &[]).to_string());
        assert!(words[0].contains("cannot be read") && words[1].contains("data stopped 2.3 s ago"), "{words:?}");
        // After a silence all is asked anew; the frame was "sent for inf s".
        client.restart();
        let words = client.diagnosis(2.8, &[]).to_string();
        assert!(!words.contains("one and the same"), "{version}: {words}");
    }
}

proptest! {
    #[test]
    fn random_frames_round_trip_in_every_version(
        which in 0usize..VERSIONS.len(), number: i32, bodies in proptest::collection::vec((any::<i32>(), proptest::array::uniform3(-5f32..5.0), proptest::array::uniform4(-1f32..1.0), any::<u16>()), 0..4),
        others in proptest::collection::vec(proptest::array::uniform3(-5f32..5.0), 0..4), samples in proptest::collection::vec(proptest::collection::vec(-9f32..9.0, 0..3), 0..3), name in "[a-z]{0,9}",
    ) {
        let v = VERSIONS[which];
        let mut f = Frame { number, other_markers: others, ..Frame::default() };
        f.rigid_bodies = bodies.into_iter().map(|(id, position, quaternion_xyzw, params)| RigidBody {
            id, position, quaternion_xyzw, error: 0.25, markers: vec![], params: v.since(2, 6).then_some(params),
        }).collect();
        f.marker_sets = vec![MarkerSet { name, markers: f.other_markers.clone() }];
        if v.since(2, 1) {
            f.skeletons = vec![Skeleton { id: 5, bones: f.rigid_bodies.clone() }];
        }
        if v.since(2, 9) {
            f.force_plates = vec![ChannelData { id: 1, channels: samples }];
        }
        f.suffix.timestamp = 12.5;
        let bytes = f.encode(v);
        prop_assert_eq!(Frame::decode(&bytes[4..], v), Ok(f));
    }

    #[test]
    fn random_datagrams_are_survived_by_client_and_server(id in 0u16..16, payload in proptest::collection::vec(any::<u8>(), 0..300), which in 0usize..VERSIONS.len()) {
        let bytes = message::datagram(MessageId::from_number(id), &payload);
        let forced = ClientOptions { force_version: Some(VERSIONS[which]), ..ClientOptions::default() };
        let _ = Client::new(forced).receive(&bytes, 1.0);
        let _ = server(VERSIONS[which], UpAxis::Y).receive(&bytes, 1.0);
        let _ = definitions(&payload, VERSIONS[which]);
    }
}
