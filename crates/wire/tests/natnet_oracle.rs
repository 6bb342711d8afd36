//! The independent crate `natnet` reads our fake Motive, and our client reads its synthetic server.

use monro_geometry::{Rigid, Tool, Tracker, Vector};
use monro_wire::natnet::{Client, ClientOptions, Event, Frame, Server, ServerOptions, UpAxis, Version};
use natnet::{Decoder, Message, PlannedBody, SyntheticServer};

const VERSIONS: [(u8, u8); 4] = [(3, 0), (3, 1), (4, 0), (4, 1)];

fn fake_motive(major: u8, minor: u8) -> Server {
    Server::new(ServerOptions {
        version: Version::new(major, minor),
        bodies: vec!["Stylus".to_owned(), "Reference".to_owned()],
        frequency: 3_312_787,
        data_port: 1511,
        multicast: true,
        up: UpAxis::Z,
        rate: 120.0,
    })
}

#[test]
fn the_oracle_reads_our_fake_motive() {
    for (major, minor) in VERSIONS {
        let mut server = fake_motive(major, minor);
        let decoder = Decoder::new(natnet::Version::new(major, minor, 0, 0)).expect("known to the oracle");

        let info = decoder.parse(&server.info().encode()).expect("server info").into_message();
        let Message::ServerInfo(info) = info else { panic!("{info:?}") };
        assert_eq!((info.application_name.as_str(), info.high_res_clock_frequency), ("Motive", 3_312_787));
        assert_eq!((info.connection.data_port, info.connection.multicast_group), (1511, [239, 255, 42, 99]));

        let question = [4, 0, 0, 0];
        let answer = server.receive(&question, 0.0).expect("request").expect("answer");
        let models = decoder.parse(&answer).expect("model definition").into_message();
        let Message::ModelDef(models) = models else { panic!("{models:?}") };
        let names: Vec<_> = models.rigid_bodies().map(|(n, id)| (n.to_owned(), id)).collect();
        assert_eq!(names, [("Stylus".to_owned(), 1), ("Reference".to_owned(), 2)]);

        let pose = Rigid::<Tracker, Tool>::from_quaternion([0.6, 0.0, 0.8, 0.0], Vector::new(100.0, 200.0, 300.0));
        let bytes = server.frame(&[(pose, 0.25), (None, 0.0)], 10.0, 10.005);
        let message = decoder.parse(&bytes).expect("frame");
        assert_eq!(message.to_datagram().as_deref(), Ok(bytes.as_slice()), "{major}.{minor}");
        let Message::FrameOfData(frame) = message.into_message() else { panic!("no frame") };
        let (stylus, lost) = (&frame.rigid_bodies[0], &frame.rigid_bodies[1]);
        assert_eq!((stylus.position, stylus.orientation), ([0.1, 0.2, 0.3], [0.0, 0.8, 0.0, 0.6]));
        assert_eq!((stylus.params, lost.params, stylus.mean_marker_error), (1, 0, 0.000_25));
        assert_eq!(frame.timing.camera_mid_exposure, 33_127_870);
    }
}

#[test]
fn we_read_the_oracles_synthetic_server() {
    for (major, minor) in VERSIONS {
        let theirs = natnet::Version::new(major, minor, 0, 0);
        let synthetic = SyntheticServer::new(theirs, 10_000_000);
        let bodies = [PlannedBody::tracked(7, [0.5, -0.25, 1.0], [0.0, 0.0, 0.0, 1.0]), PlannedBody::dropout(8)];
        let bytes = synthetic.frame(42, 3.5, &bodies).to_datagram(theirs).expect("their own frame");

        let version = Version::new(major, minor);
        let read = Frame::decode(&bytes[4..], version).expect("frame");
        assert_eq!((read.number, read.faults.as_slice()), (42, [].as_slice()));
        assert_eq!(read.encode(version), bytes, "{version}");

        let options = ClientOptions { force_version: Some(version), up: UpAxis::Z, bitstream: None };
        let event = Client::new(options).receive(&bytes, 0.0).expect("frame");
        let Some(Event::Frame(_, poses)) = event else { panic!("{event:?}") };
        let at = poses[0].tracker_from_tool.expect("tracked").translation();
        assert_eq!((poses[0].name.as_str(), at.to_array()), ("#7", [500.0, -250.0, 1000.0]));
        assert!(poses[1].tracker_from_tool.is_none());
    }
}

#[test]
fn the_oracles_server_info_starts_our_client() {
    let info = natnet::ServerInfo {
        application_name: "Motive".to_owned(),
        server_version: natnet::Version::new(3, 1, 2, 1),
        protocol_version: natnet::Version::new(4, 1, 0, 0),
        high_res_clock_frequency: 10_000_000,
        connection: natnet::ConnectionInfo { data_port: 1511, multicast: true, multicast_group: [239, 255, 42, 99] },
    };
    let mut client = Client::new(ClientOptions::default());
    client.receive(&info.to_datagram().expect("their own info"), 0.0).expect("server info");
    assert_eq!(client.version(), Some(Version::new(4, 1)));
}
