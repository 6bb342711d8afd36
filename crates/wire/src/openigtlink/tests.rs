//! Spec vectors, truncations, corruptions, and round trips of every kind of message.

use super::*;
use monro_geometry::{Patient, Point, Rigid, Tool, Tracker, TriangleMesh, Vector};
use proptest::prelude::*;

/// The named message of `tests/vectors/openigtlink.hex`.
fn vector(name: &str) -> Vec<u8> {
    crate::bytes::vectors::named(include_str!("../../tests/vectors/openigtlink.hex"), name)
}

const VECTORS: [&str; 13] = [
    "transform",
    "qtdata",
    "tdata",
    "status",
    "string",
    "position",
    "traj",
    "polydata",
    "image",
    "transform_v2",
    "welcome",
    "transform_v2_metadata",
    "capability",
];

/// 1700000000.5 s, the time of the vectors.
const TIME: Timestamp = Timestamp(0x6553_f100_8000_0000);

fn read(name: &str) -> Message {
    Message::from_bytes(&vector(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn every_vector_is_read_and_written_back_to_the_same_bytes() {
    for name in VECTORS {
        let mut expected = vector(name);
        if name == "qtdata" {
            // The reference library leaves the padding byte after the type as it finds it in memory; we write 0.
            expected[HEADER_SIZE + 21] = 0;
            let sum = crc64(&expected[HEADER_SIZE..]);
            expected[50..HEADER_SIZE].copy_from_slice(&sum.to_be_bytes());
        }
        assert_eq!(read(name).encode().expect(name), expected, "{name}");
    }
}

/// Rotation +90 degrees about x, translation (10.5, -20.25, 30.125).
fn quarter_turn() -> Rigid<Tracker, Tool> {
    let about = Vector::new(1.0, 0.0, 0.0);
    Rigid::from_axis_angle(about, core::f64::consts::FRAC_PI_2, Vector::new(10.5, -20.25, 30.125)).expect("axis")
}

fn same(a: &Rigid<Tracker, Tool>, b: &Rigid<Tracker, Tool>) -> bool {
    // Single precision on the wire: 2^-24 of 1 in the rotation, of 30 mm in the translation.
    a.inverse().after(b).angle() < 1e-6 && (a.translation() - b.translation()).norm() < 1e-5
}

#[test]
fn the_pose_vectors_hold_the_pose_that_they_should() {
    for (name, tool) in [("transform", "StylusToReference"), ("tdata", "Stylus"), ("qtdata", "Stylus")] {
        let found = poses(&read(name), 7.0);
        assert_eq!((found.len(), found[0].name.as_str()), (1, tool));
        assert_eq!((found[0].source_time, found[0].arrival_time), (Some(1_700_000_000.5), 7.0));
        assert!(same(&found[0].tracker_from_tool.expect("tracked"), &quarter_turn()), "{name}");
    }
    let Content::Position(p) = read("position").content else { panic!("position") };
    assert_eq!((p.position, p.quaternion_xyzw), ([1.0, 2.0, 3.0], Some([0.0, 0.0, 0.0, 1.0])));
}

#[test]
fn the_word_vectors_say_what_they_should() {
    let Content::Status(s) = read("status").content else { panic!("status") };
    assert_eq!((s.code, s.name.as_str(), s.message.as_str()), (StatusCode::Ok, "OK", "tracking"));
    let Content::Text(t) = read("string").content else { panic!("string") };
    assert_eq!((t.encoding, t.text.as_str()), (TextEncoding::Ascii, "1.25"));
    let Content::Capability(names) = read("capability").content else { panic!("capability") };
    assert_eq!(names, ["IMAGE", "GET_IMAGE", "TRANSFORM", "GET_TRANS"]);
    let with_metadata = read("transform_v2_metadata");
    assert_eq!(with_metadata.id, 1);
    assert_eq!(with_metadata.meta("first patient AGE"), Some("22"));
    assert_eq!(with_metadata.meta("Second patient age"), Some("25"));
    assert_eq!(read("transform_v2").meta("TransformStatus"), Some("OK"));
}

#[test]
fn the_shape_vectors_have_their_shapes() {
    let Content::Trajectories(t) = read("traj").content else { panic!("traj") };
    assert_eq!((t[0].entry, t[0].target, t[0].diameter), ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0], 1.5));
    let Content::PolyData(mesh) = read("polydata").content else { panic!("polydata") };
    let mesh = mesh.to_mesh();
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 4));
    assert_eq!(PolyData::from_mesh(&mesh).to_mesh(), mesh);
    let Content::Image(image) = read("image").content else { panic!("image") };
    assert_eq!((image.size, image.pixels.as_slice()), ([2, 2, 1], [1u8, 2, 3, 4].as_slice()));
    assert_eq!(image.first_voxel(), [-0.25, -0.25, 0.0]);
}

#[test]
fn every_truncation_is_refused_by_name_and_waited_for_in_a_stream() {
    for name in VECTORS {
        let whole = vector(name);
        for end in 0..whole.len() {
            let e = Message::from_bytes(&whole[..end]).expect_err(name);
            assert!(matches!(e, IgtlError::Read { .. } | IgtlError::ContentSize { .. }), "{name} {end}: {e}");
            let mut p = Parser::default();
            p.push(&whole[..end]);
            assert!(p.next_message().is_none(), "{name} {end}");
        }
    }
}

#[test]
fn every_corruption_of_a_body_is_seen_by_the_checksum() {
    for name in VECTORS {
        let mut bytes = vector(name);
        for at in HEADER_SIZE..bytes.len() {
            for flip in 1..=255 {
                bytes[at] ^= flip;
                let e = Message::from_bytes(&bytes).expect_err(name);
                assert!(matches!(e, IgtlError::Checksum { .. }), "{name} {at}: {e}");
                bytes[at] ^= flip;
            }
        }
    }
}

/// The same with the checksum put right again, so that the decoders behind it meet every corrupted byte.
#[test]
fn every_corruption_behind_a_valid_checksum_is_survived() {
    for name in VECTORS {
        let original = vector(name);
        for at in 0..original.len() {
            for flip in 1..=255 {
                let mut bytes = original.clone();
                bytes[at] ^= flip;
                let sum = crc64(&bytes[HEADER_SIZE..]);
                bytes[50..HEADER_SIZE].copy_from_slice(&sum.to_be_bytes());
                if let Ok(m) = Message::from_bytes(&bytes) {
                    let _ = poses(&m, 0.0);
                    assert!(!matches!(m.content, Content::PolyData(p) if p.points.len() > bytes.len() / 12));
                }
            }
        }
    }
}

#[test]
fn a_damaged_message_is_dropped_and_the_stream_goes_on() {
    let (mut damaged, good) = (vector("status"), vector("transform"));
    damaged[70] ^= 1;
    let mut unknown_version = vector("string");
    unknown_version[1] = 3;
    let mut p = Parser::default();
    p.push(&[damaged, unknown_version, good].concat());
    assert!(matches!(p.next_message(), Some(Err(IgtlError::Checksum { .. }))));
    assert!(matches!(p.next_message(), Some(Err(IgtlError::HeaderVersion { version: 3, .. }))));
    assert!(matches!(p.next_message(), Some(Ok(m)) if m.device == "StylusToReference"));
    assert!(p.next_message().is_none() && p.pending() == 0);
}

#[test]
fn a_huge_body_is_refused_before_it_is_allocated() {
    let mut bytes = vector("transform");
    bytes[42..50].copy_from_slice(&u64::MAX.to_be_bytes());
    let mut p = Parser::new(1 << 20);
    p.push(&bytes);
    assert!(matches!(p.next_message(), Some(Err(IgtlError::BodyTooLarge { size: u64::MAX, .. }))));
    p.push(&[0; 1000]);
    assert!(p.is_broken() && p.pending() == 0);
}

/// A volume on the connection ended `track` and what it recorded, and its message asked for a setting that there is not.
#[test]
fn a_body_that_is_too_large_to_be_held_ended_the_stream() {
    let pose = vector("transform");
    let mut volume = pose[..HEADER_SIZE].to_vec();
    volume[42..50].copy_from_slice(&3_000_000u64.to_be_bytes());
    volume.resize(HEADER_SIZE + 3_000_000, 7);
    let stream = [&pose[..], &volume, &pose, &pose].concat();
    for piece in [1000, 65_536, stream.len()] {
        let (mut p, mut poses, mut skipped) = (Parser::new(1 << 20), 0, 0);
        for bytes in stream.chunks(piece) {
            p.push(bytes);
            while let Some(message) = p.next_message() {
                match message {
                    Ok(_) => poses += 1,
                    Err(IgtlError::BodySkipped { size: 3_000_000, .. }) => skipped += 1,
                    Err(e) => panic!("{e}"),
                }
            }
            assert!(p.pending() <= piece.max(pose.len()), "a volume is not held");
        }
        assert_eq!((poses, skipped, p.is_broken(), p.pending()), (3, 1, false, 0));
    }
}

#[test]
fn an_unknown_type_is_skipped_and_queries_are_understood() {
    let unknown = Content::Unknown { type_name: "VIDEO".to_owned(), size: 0 };
    let queries = [
        unknown,
        Content::Query { verb: Verb::Get, of: "TRANS".to_owned(), stream: None },
        Content::Query {
            verb: Verb::Start,
            of: "TDATA".to_owned(),
            stream: Some(StreamRequest { interval_ms: 20, coordinate_system: "Reference".to_owned() }),
        },
        Content::Query { verb: Verb::Stop, of: "QTDATA".to_owned(), stream: None },
        Content::Answer { of: "TDATA".to_owned(), accepted: true },
        Content::Answer { of: "TRANS".to_owned(), accepted: false },
    ];
    for content in queries {
        let m = Message::v1("x", None, content);
        assert_eq!(Message::from_bytes(&m.encode().expect("encode")).as_ref(), Ok(&m));
    }
}

#[test]
fn names_that_do_not_fit_are_refused_not_cut() {
    let m = Message::v1("InstrumentToReference", None, Content::Text(Text::new("x")));
    assert!(matches!(m.encode(), Err(IgtlError::TooLong { size: 21, limit: 20, .. })));
}

#[test]
fn a_lost_tool_keeps_flowing_without_its_pose() {
    let m = Message::transform("StylusToReference", Some(TIME), 3, Some(&quarter_turn()), ToolStatus::OutOfVolume);
    assert!(matches!(m.content, Content::Transform(Matrix34::IDENTITY)));
    let back = &poses(&Message::from_bytes(&m.encode().expect("encode")).expect("read"), 1.0)[0];
    assert_eq!(back.quality, crate::Quality::Missing(crate::Missing::OutOfVolume));
    assert!(back.tracker_from_tool.is_none());
    let silent = Message::transform("StylusToReference", None, 4, None, ToolStatus::Ok);
    assert_eq!(silent.meta("TransformStatus"), Some("MISSING"));
}

#[test]
fn tool_status_is_read_in_all_its_spellings() {
    let read = |v: &str| ToolStatus::parse(v);
    assert_eq!((read("ok"), read("SWITCH1_IS_ON")), (ToolStatus::Ok, ToolStatus::Ok));
    assert_eq!((read("TOOL_MISSING"), read("INVALID")), (ToolStatus::Missing, ToolStatus::Missing));
    assert_eq!((read("tool_out_of_view"), read("")), (ToolStatus::OutOfVolume, ToolStatus::Missing));
    let with =
        |valid: &str| Message::v2("a", None, 1, Content::Transform(Matrix34::IDENTITY)).with("TransformValid", valid);
    // "0.0" and "false" were taken for a pose that is valid: a lost tool stayed where it was last.
    for (valid, is_seen) in [("0", false), ("0.0", false), (" False ", false), ("1", true), ("true", true), ("", true)]
    {
        assert_eq!(poses(&with(valid), 0.0)[0].tracker_from_tool.is_some(), is_seen, "{valid:?}");
    }
    let m = with("0");
    let both = m.with("TransformStatus", "OK");
    assert!(poses(&both, 0.0)[0].tracker_from_tool.is_none());
}

#[test]
fn a_name_longer_than_its_field_comes_from_the_metadata() {
    let m = Message::v2("InstrumentToReferenc", None, 1, Content::Transform(Matrix34::IDENTITY))
        .with("IGTL_DEVICE_NAME", "InstrumentToReference");
    assert_eq!(poses(&m, 0.0)[0].name, "InstrumentToReference");
}

#[test]
fn mesh_attributes_survive_and_bad_indices_do_not() {
    let triangle: &[u32] = &[0, 1, 2];
    let mut p = PolyData { points: vec![[0.0; 3]; 3], polygons: Cells::new([triangle]), ..PolyData::default() };
    let scalars = |on_cells, name: &str, values| Attribute {
        kind: AttributeKind::Scalars,
        on_cells,
        components: 1,
        name: name.to_owned(),
        values,
    };
    p.attributes = vec![scalars(false, "attr", vec![1.0, 2.0, 3.0]), scalars(true, "c", vec![4.0])];
    let m = Message::v1("Brain", Some(TIME), Content::PolyData(p.clone()));
    assert_eq!(Message::from_bytes(&m.encode().expect("encode")), Ok(m));
    let bad: &[u32] = &[0, 1, 3];
    p.polygons = Cells::new([bad]);
    let m = Message::v1("Brain", None, Content::PolyData(p));
    assert_eq!(m.encode(), Err(IgtlError::Index { index: 3, points: 3 }));
}

#[test]
fn strips_and_quads_become_triangles_of_one_orientation() {
    let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let (strip, quad): (&[u32], &[u32]) = (&[0, 1, 2, 3], &[0, 1, 3, 2]);
    for p in [
        PolyData { points: points.clone(), strips: Cells::new([strip]), ..PolyData::default() },
        PolyData { points, polygons: Cells::new([quad]), ..PolyData::default() },
    ] {
        let mesh: TriangleMesh = p.to_mesh();
        assert_eq!(mesh.triangles.len(), 2);
        assert!((0..2).all(|t| (mesh.area_vector(t) - Vector::<Patient>::new(0.0, 0.0, 0.5)).norm() < 1e-9));
    }
    assert_eq!(patient_of([1.0, 2.0, 3.0]), Point::new(-1.0, -2.0, 3.0));
}

#[test]
fn times_round_trip_and_impossible_ones_are_none() {
    assert_eq!(Timestamp::from_seconds(1_700_000_000.5), Some(TIME));
    assert_eq!(TIME.seconds(), 1_700_000_000.5);
    assert!([-1.0, 0.0, f64::NAN, 5e9].iter().all(|&t| Timestamp::from_seconds(t).is_none()));
}

#[test]
fn places_without_an_orientation_and_quaternions_of_any_length_were_full_poses() {
    let missing = |content| {
        let [pose] = &poses(&Message::v1("Tool", None, content), 0.0)[..] else { panic!("one pose") };
        match pose.quality {
            crate::Quality::Tracked { .. } => None,
            crate::Quality::Missing(why) => Some(why),
        }
    };
    let (position, turned) = ([1.0, 2.0, 3.0], [0.0, 0.6, 0.0, 0.8]);
    let of_kind = |kind| {
        let name = "Tool".to_owned();
        missing(Content::TrackingData(vec![TrackingElement { name, kind, matrix: Matrix34::IDENTITY }]))
    };
    assert_eq!(of_kind(InstrumentKind::Instrument3D), Some(crate::Missing::NoOrientation));
    assert_eq!([InstrumentKind::Instrument6D, InstrumentKind::Tracker].map(of_kind), [None; 2]);
    let placed = |quaternion_xyzw| missing(Content::Position(Position { position, quaternion_xyzw }));
    assert_eq!(placed(None), Some(crate::Missing::NoOrientation));
    assert_eq!(placed(Some(turned)), None);
    for length in [0.5f32, 1.02, 3.2, 1e-5, f32::NAN] {
        assert_eq!(placed(Some(turned.map(|v| v * length))), Some(crate::Missing::NotRigid), "{length}");
    }
}

fn any_content() -> impl Strategy<Value = Content> {
    let f3 = || proptest::array::uniform3(-1e3f32..1e3);
    let f4 = || proptest::array::uniform4(-1.0f32..1.0);
    let name = || "[a-zA-Z0-9 ]{0,20}";
    prop_oneof![
        proptest::array::uniform4(f3()).prop_map(|columns| Content::Transform(Matrix34 { columns })),
        (f3(), proptest::option::of(f4()))
            .prop_map(|(position, quaternion_xyzw)| Content::Position(Position { position, quaternion_xyzw })),
        proptest::collection::vec((name(), f3(), f4()), 0..4).prop_map(|list| {
            let kind = InstrumentKind::Instrument6D;
            let one = |(name, position, quaternion_xyzw)| QuaternionElement { name, kind, position, quaternion_xyzw };
            Content::QuaternionTrackingData(list.into_iter().map(one).collect())
        }),
        (0u16..25, any::<i64>(), name(), "[a-z ]{0,40}").prop_map(|(code, sub_code, name, message)| {
            Content::Status(Status { code: StatusCode::from_number(code), sub_code, name, message })
        }),
        ".{0,80}".prop_map(|t| Content::Text(Text::new(t))),
        proptest::collection::vec((name(), name(), any::<[u8; 4]>(), f3()), 0..4).prop_map(|list| {
            let one = |(name, group, rgba, position)| PointElement {
                name,
                group,
                rgba,
                position,
                diameter: 2.0,
                owner: "Reference".to_owned(),
            };
            Content::Points(list.into_iter().map(one).collect())
        }),
        (any::<u32>(), name(), ".{0,60}").prop_map(|(id, name, text)| {
            Content::Command(Command { id, name, encoding: TextEncoding::of(&text), text })
        }),
    ]
}

proptest! {
    #[test]
    fn every_message_round_trips_however_the_stream_is_cut(
        contents in proptest::collection::vec(any_content(), 1..5), cuts in proptest::collection::vec(1usize..97, 1..8), v2: bool,
    ) {
        let make = |(i, c): (usize, Content)| match v2 {
            true => Message::v2("Device", Some(TIME), i as u32, c).with("Status", "OK").with("key", "wert \u{e4}"),
            false => Message::v1("Device", Some(TIME), c),
        };
        let sent: Vec<Message> = contents.into_iter().enumerate().map(make).collect();
        let bytes: Vec<u8> = sent.iter().flat_map(|m| m.encode().expect("encode")).collect();
        let (mut parser, mut got, mut at, mut turn) = (Parser::default(), Vec::new(), 0, 0);
        while at < bytes.len() {
            let end = (at + cuts[turn % cuts.len()]).min(bytes.len());
            parser.push(&bytes[at..end]);
            while let Some(m) = parser.next_message() {
                got.push(m.expect("valid"));
            }
            (at, turn) = (end, turn + 1);
        }
        prop_assert_eq!(got, sent);
    }

    #[test]
    fn random_bodies_of_every_type_are_survived(which in 0usize..16, body in proptest::collection::vec(any::<u8>(), 0..400), version in 1u8..3) {
        const TYPES: [&str; 16] = ["TRANSFORM", "POSITION", "QTRANS", "TDATA", "QTDATA", "STATUS", "STRING", "POINT", "TRAJ",
            "POLYDATA", "IMAGE", "CAPABILITY", "COMMAND", "RTS_COMMAND", "STT_TDATA", "RTS_TDATA"];
        let mut w = W::new();
        w.u16(version.into());
        w.fixed_text(TYPES[which], 12);
        w.fixed_text("d", 20);
        w.u64(0);
        w.u64(body.len() as u64);
        w.u64(crc64(&body));
        w.bytes(&body);
        if let Ok(m) = Message::from_bytes(&w.0) {
            let _ = (poses(&m, 0.0), m.encode());
        }
    }
}
