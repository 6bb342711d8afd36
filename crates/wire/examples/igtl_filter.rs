//! OpenIGTLink over standard input and output, for the foreign oracles.
//!
//! `igtl_filter echo` reads messages and writes each of them again with our encoder; `igtl_filter emit 1|2` writes one
//! message of each kind in that header version. A message that cannot be read is told on standard error and ends it.

use monro_geometry::{Rigid, Tool, Tracker, TriangleMesh, Vector};
use monro_wire::openigtlink::{
    Attribute, AttributeKind, ByteOrder, Content, Image, ImageAxes, InstrumentKind, Matrix34, Message, Parser,
    PointElement, PolyData, Position, QuaternionElement, ScalarType, Status, StatusCode, Text, Timestamp,
    TrackingElement, Trajectory, TrajectoryKind,
};
use std::error::Error;
use std::io::{Read, Write};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["echo"] => echo(),
        ["emit", version @ ("1" | "2")] => emit(*version == "2"),
        _ => Err("usage: igtl_filter echo | emit 1|2".into()),
    }
}

fn echo() -> Result<(), Box<dyn Error>> {
    let (mut input, mut output) = (std::io::stdin().lock(), std::io::stdout().lock());
    let (mut parser, mut buffer) = (Parser::default(), [0u8; 4096]);
    loop {
        let n = input.read(&mut buffer)?;
        if n == 0 {
            return Ok(());
        }
        parser.push(&buffer[..n]);
        while let Some(message) = parser.next_message() {
            output.write_all(&message?.encode()?)?;
        }
        output.flush()?;
    }
}

fn emit(v2: bool) -> Result<(), Box<dyn Error>> {
    let time = Timestamp::from_seconds(1_700_000_000.5);
    for (i, (device, content)) in (1u32..).zip(contents()?) {
        let message = match v2 {
            true => Message::v2(device, time, i, content).with("Status", "OK").with("Note", "gr\u{fc}n"),
            false => Message::v1(device, time, content),
        };
        std::io::stdout().write_all(&message.encode()?)?;
    }
    Ok(())
}

fn contents() -> Result<Vec<(&'static str, Content)>, Box<dyn Error>> {
    let about = Vector::new(1.0, 0.0, 0.0);
    let pose = Rigid::<Tracker, Tool>::from_axis_angle(about, 0.5, Vector::new(10.5, -20.25, 30.125)).ok_or("pose")?;
    let kind = InstrumentKind::Instrument6D;
    let matrix = Matrix34::from_rigid(&pose);
    let point = |name: &str, position| PointElement {
        name: name.to_owned(),
        group: "Fiducial".to_owned(),
        rgba: [255, 0, 10, 255],
        position,
        diameter: 2.5,
        owner: "Plan".to_owned(),
    };
    Ok(vec![
        ("StylusToReference", Content::Transform(matrix)),
        ("Tip", Content::Position(Position::from_rigid(&pose))),
        ("Tools", Content::TrackingData(vec![TrackingElement { name: "Stylus".to_owned(), kind, matrix }])),
        ("QTools", Content::QuaternionTrackingData(vec![QuaternionElement::from_rigid("Stylus", &pose)])),
        (
            "Health",
            Content::Status(Status {
                code: StatusCode::NotReady,
                sub_code: -7,
                name: "LOST".to_owned(),
                message: "stylus not seen".to_owned(),
            }),
        ),
        ("EntryError", Content::Text(Text::new("1.25 mm"))),
        ("Plan", Content::Points(vec![point("Entry", [1.0, 2.0, 3.0]), point("Target", [4.0, 5.5, -6.0])])),
        ("Path", Content::Trajectories(vec![trajectory()])),
        ("Brain", Content::PolyData(tetrahedron())),
        ("Slice", Content::Image(image())),
    ])
}

fn trajectory() -> Trajectory {
    Trajectory {
        name: "EVD".to_owned(),
        group: "Trajectory".to_owned(),
        kind: TrajectoryKind::Both,
        rgba: [0, 255, 0, 255],
        entry: [1.0, 2.0, 3.0],
        target: [4.0, 5.0, 6.0],
        diameter: 3.0,
        owner: String::new(),
    }
}

fn tetrahedron() -> PolyData {
    let corners = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
    let mesh = TriangleMesh {
        vertices: corners.map(monro_geometry::Point::from_array).to_vec(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    let name = "shift".to_owned();
    let values = vec![0.0, 0.5, 1.0, 1.5];
    let attribute = Attribute { kind: AttributeKind::Scalars, on_cells: false, components: 1, name, values };
    PolyData { attributes: vec![attribute], ..PolyData::from_mesh(&mesh) }
}

fn image() -> Image {
    let (axes, size) = ([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 2.0]], [4, 3, 2]);
    let values: Vec<i16> = (0..24).map(|i| i * 100 - 1024).collect();
    Image {
        components: 1,
        scalar: ScalarType::I16,
        order: ByteOrder::Little,
        coordinates: ImageAxes::Ras,
        size,
        axes,
        centre: Image::centre_of([-10.0, 20.0, 30.0], &axes, size),
        part_start: [0; 3],
        part_size: size,
        pixels: values.iter().flat_map(|v| v.to_le_bytes()).collect(),
    }
}
