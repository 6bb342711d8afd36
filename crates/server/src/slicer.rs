//! An OpenIGTLink server beside the web one, so that 3D Slicer (or anything else that speaks it) shows the same: the
//! catheter, the deformed ventricles, the plan, the numbers, and once the CT. Coordinates are RAS, as the protocol has them.
//!
//! | device | type | how often |
//! |---|---|---|
//! | `Catheter` | TRANSFORM: origin at the tip, +z from hub to tip; when it is lost, 10 m above the head. `TransformStatus`: `OK`, `MISSING` when lost, `OUT_OF_VOLUME` when stale, after the reference has moved, and while poses are frozen | 30 Hz |
//! | `Ventricles` | POLYDATA, deformed | when it has changed, 10 Hz at most |
//! | `Plan` | POINT: entry, target, and while it is known target in the deformed tissue | 10 Hz |
//! | `Guidance` | STRING: the numbers in words, and what is wrong with the tracker though poses come | 10 Hz |
//! | `Monro` | STATUS with the same words: OK when live and nothing is wrong, else a code and `lost`, `not navigating`, `stale`, `reference moved`, `poses frozen` or `tissue in doubt` | 10 Hz |
//! | `CT` | IMAGE | at the beginning, and for GET_IMAGE |

use crate::ServeError;
use crate::bound::Bound;
use crate::live::Live;
use monro_case::Case;
use monro_geometry::{Embedding, EmbeddingError, Patient, Point, Rigid, Tool, Vector, Volume};
use monro_guidance::{NeedlePose, Plan};
use monro_session::live::{Freshness, Phase, Snapshot};
use monro_wire::openigtlink::{
    ByteOrder, Cells, Content, Image, ImageAxes, Matrix34, Message, Parser, PointElement, PolyData, Ras, ScalarType,
    Status, StatusCode, Text, Timestamp, ToolStatus, Verb, ras_from_patient, ras_of,
};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::OwnedWriteHalf;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::{MissedTickBehavior, interval, sleep, timeout};

/// Peers at a time.
const MOST_PEERS: usize = 8;
/// Of the catheter.
const TICK: Duration = Duration::from_millis(33);
/// How often the session is asked whether it stops while nobody comes.
const LOOK: Duration = Duration::from_millis(200);
/// Everything else comes with every third tick: 10 Hz at most.
const SLOW: u32 = 3;
/// A peer that does not take a message for this long is gone.
const PATIENCE: Duration = Duration::from_secs(10);
/// Questions are small.
const MOST_BODY_BYTES: usize = 1 << 16;
/// Voxels of the CT that are sent at most.
pub(crate) const MOST_VOXELS: usize = 1 << 23;

/// What is the same for all peers.
#[derive(Debug)]
pub(crate) struct Scene {
    plan: Plan,
    ventricles: Vec<Point<Patient>>,
    bound: Bound,
    cells: Cells,
    image: Option<Image>,
}

impl Scene {
    /// The scene of a case.
    ///
    /// # Errors
    /// When the ventricles cannot be bound to the tetrahedra.
    pub(crate) fn new(case: &Case, image: Option<Image>) -> Result<Self, EmbeddingError> {
        let mesh = &case.ventricles;
        let embedding = Embedding::new(&case.tets, &mesh.vertices)?;
        Ok(Self {
            plan: case.plan,
            ventricles: mesh.vertices.clone(),
            bound: Bound::from(&embedding),
            cells: Cells::new(mesh.triangles.iter().map(|t| t.as_slice())),
            image,
        })
    }

    /// The ventricles with their nodes displaced.
    fn deformed(&self, displacements: &[[f32; 3]]) -> PolyData {
        let moved = self.bound.displacements(displacements).map(|d| Vector::from_array(d.map(f64::from)));
        let points = self.ventricles.iter().zip(moved).map(|(rest, d)| ras_of(*rest + d)).collect();
        PolyData { points, polygons: self.cells.clone(), ..PolyData::default() }
    }

    fn plan(&self, deformed_target: Option<Point<Patient>>) -> Content {
        let point = |name: &str, rgba: [u8; 4], p: Point<Patient>| PointElement {
            name: name.to_owned(),
            group: "Plan".to_owned(),
            rgba,
            position: ras_of(p),
            diameter: 2.0,
            owner: String::new(),
        };
        let mut points = vec![
            point("Entry", [80, 200, 255, 255], self.plan.entry()),
            point("Target", [160, 160, 160, 255], self.plan.target()),
        ];
        points.extend(deformed_target.map(|target| point("Target deformed", [255, 200, 60, 255], target)));
        Content::Points(points)
    }
}

/// An IMAGE of 16-bit HU from every `stride`th voxel of a CT.
pub(crate) fn image(volume: &Volume<i16>, stride: [usize; 3]) -> Option<Image> {
    let grid = volume.grid();
    let size: [usize; 3] = core::array::from_fn(|a| grid.dims()[a].div_ceil(stride[a]));
    let size = [u16::try_from(size[0]).ok()?, u16::try_from(size[1]).ok()?, u16::try_from(size[2]).ok()?];
    let linear = &grid.patient_from_voxel().linear;
    // RAS: x and y of the patient's LPS with their signs changed.
    let axes = core::array::from_fn(|a| {
        let [x, y, z] = linear.column(a).map(|v| (v * stride[a] as f64) as f32);
        [-x, -y, z]
    });
    let mut pixels = Vec::with_capacity(size.iter().map(|&s| usize::from(s)).product::<usize>() * 2);
    let [ni, nj, nk] = size.map(usize::from);
    for (k, j, i) in (0..nk).flat_map(|k| (0..nj).flat_map(move |j| (0..ni).map(move |i| (k, j, i)))) {
        pixels.extend(volume.at(i * stride[0], j * stride[1], k * stride[2]).to_le_bytes());
    }
    let centre = Image::centre_of(ras_of(grid.centre(0, 0, 0)), &axes, size);
    let (order, coordinates) = (ByteOrder::Little, ImageAxes::Ras);
    let (part_start, part_size) = ([0; 3], size);
    Some(Image {
        components: 1,
        scalar: ScalarType::I16,
        order,
        coordinates,
        size,
        axes,
        centre,
        part_start,
        part_size,
        pixels,
    })
}

/// Opens the port. One that somebody else has is replaced by any free one: nobody who serves two cases at once should have
/// to think of it.
///
/// # Errors
/// When others could reach the address, or it cannot be had.
pub(crate) async fn listen(address: SocketAddr) -> Result<TcpListener, ServeError> {
    if !address.ip().is_loopback() {
        return Err(ServeError::OpenIgtLink(address));
    }
    match TcpListener::bind(address).await {
        Err(error) if error.kind() == io::ErrorKind::AddrInUse => {
            Ok(TcpListener::bind(SocketAddr::new(address.ip(), 0)).await?)
        }
        other => other.map_err(|error| ServeError::Listen { address, error }),
    }
}

/// Takes peers until the session stops.
pub(crate) async fn serve(listener: TcpListener, live: Arc<Live>, scene: Arc<Scene>) {
    let seats = Arc::new(Semaphore::new(MOST_PEERS));
    while !live.is_stopping() {
        let accepted = timeout(LOOK, listener.accept()).await;
        let Ok(Ok((mut stream, _))) = accepted else {
            if accepted.is_ok() {
                // Too many open files, perhaps: not again at once.
                sleep(LOOK).await;
            }
            continue;
        };
        let (live, scene) = (Arc::clone(&live), Arc::clone(&scene));
        let seat = Arc::clone(&seats).try_acquire_owned();
        tokio::spawn(async move {
            // However it ends, the peer can come back.
            let _ = match seat {
                Ok(_seat) => Peer { live, scene, sent: 0, step: None }.talk(stream).await,
                Err(_) => put(&mut stream, &no_seat()).await,
            };
        });
    }
}

/// One peer. Each message is made when it can be sent: a slow peer gets fewer, and delays nobody.
struct Peer {
    live: Arc<Live>,
    scene: Arc<Scene>,
    sent: u32,
    /// The deformation that it shows.
    step: Option<u64>,
}

impl Peer {
    async fn talk(mut self, stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        let (mut reading, mut writing) = stream.into_split();
        let (asked, mut questions) = mpsc::channel(16);
        // A peer whose words make no sense is still shown what there is, until it hangs up.
        let listening = tokio::spawn(async move {
            let (mut parser, mut buffer) = (Parser::new(MOST_BODY_BYTES), vec![0; 4096]);
            while let Ok(count @ 1..) = reading.read(&mut buffer).await {
                parser.push(&buffer[..count]);
                // A broken parser gives nothing but its error, and takes nothing.
                while let Some(message) = parser.next_message().filter(|_| !parser.is_broken()) {
                    if let Ok(Message { content: Content::Query { verb, of, .. }, .. }) = message {
                        let _ = asked.send((verb, of)).await;
                    }
                }
            }
        });
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let mut count = 0u32;
        self.send(&mut writing, "CT", self.scene.image.clone().map(Content::Image)).await?;
        while !self.live.is_stopping() && !listening.is_finished() {
            tokio::select! {
                Some((verb, of)) = questions.recv() => self.answer(&mut writing, verb, &of).await?,
                _ = ticks.tick() => {
                    self.tell(&mut writing, count.is_multiple_of(SLOW)).await?;
                    count = count.wrapping_add(1);
                }
            }
        }
        Ok(())
    }

    async fn send(&mut self, to: &mut OwnedWriteHalf, device: &str, content: Option<Content>) -> io::Result<()> {
        let Some(content) = content else { return Ok(()) };
        self.sent = self.sent.wrapping_add(1);
        put(to, &Message::v2(device, None, self.sent, content)).await
    }

    async fn answer(&mut self, to: &mut OwnedWriteHalf, verb: Verb, of: &str) -> io::Result<()> {
        let known = ["TRANSFORM", "POLYDATA", "POINT", "STRING", "STATUS", "IMAGE", "GET_CAPABIL", "GET_IMAGE"];
        match (verb, of) {
            (Verb::Get, "CAPABIL" | "CAPABILITY") => {
                let list = Content::Capability(known.map(str::to_owned).to_vec());
                self.send(to, "Monro", Some(list)).await
            }
            (Verb::Get, "IMAGE") => {
                let image = self.scene.image.clone().map(Content::Image);
                self.send(to, "CT", image).await
            }
            // Everything streams without being asked for, and does not stop.
            (Verb::Start | Verb::Stop, _) if of.is_ascii() => {
                let accepted = verb == Verb::Start && known.iter().any(|k| k.starts_with(of));
                self.send(to, "Monro", Some(Content::Answer { of: of.to_owned(), accepted })).await
            }
            _ => Ok(()),
        }
    }

    async fn tell(&mut self, to: &mut OwnedWriteHalf, everything: bool) -> io::Result<()> {
        let (snapshot, guidance) = self.live.snapshot();
        let misplaced = misplaced(&snapshot, self.live.is_frozen());
        self.sent = self.sent.wrapping_add(1);
        let needle = (snapshot.needle.as_ref(), tool_status(snapshot.signal, misplaced));
        put(to, &catheter(needle, (measured(snapshot.age_s), self.sent))).await?;
        if !everything {
            return Ok(());
        }
        if self.step != Some(snapshot.deformed.step) {
            self.step = Some(snapshot.deformed.step);
            let mesh = self.scene.deformed(&snapshot.deformed.displacements);
            self.send(to, "Ventricles", Some(Content::PolyData(mesh))).await?;
        }
        let known = snapshot.numbers.as_ref().is_some_and(|n| n.soft.is_some());
        let plan = self.scene.plan(known.then_some(snapshot.deformed.target));
        self.send(to, "Plan", Some(plan)).await?;
        let words: Vec<_> = [guidance.in_words()].into_iter().chain(self.live.tracker_trouble()).collect();
        let words = words.join("; ");
        self.send(to, "Guidance", Some(Content::Text(Text::new(words.clone())))).await?;
        self.send(to, "Monro", Some(Content::Status(status(&snapshot, misplaced, words)))).await
    }
}

async fn put(to: &mut (impl AsyncWriteExt + Unpin), message: &Message) -> io::Result<()> {
    let bytes = message.encode().map_err(io::Error::other)?;
    timeout(PATIENCE, to.write_all(&bytes)).await?
}

/// What a peer is told that finds all places taken, before it is let go.
fn no_seat() -> Message {
    let message = format!("{MOST_PEERS} peers are served already: disconnect one");
    let status = Status { code: StatusCode::Busy, sub_code: 0, name: "no place".to_owned(), message };
    Message::v2("Monro", None, 1, Content::Status(status))
}

/// Where a lost catheter is: out of every view, for who draws it without reading its status. The identity would draw its
/// tip in the head.
const AWAY: Matrix34 = Matrix34 { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 10_000.0]] };

/// When what is so many seconds old was measured, by the clock of this machine.
fn measured(age_s: Option<f64>) -> Option<Timestamp> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).ok()?.as_secs_f64();
    Timestamp::from_seconds(now - age_s?)
}

/// What is wrong though poses are new: a code, and a name for people (20 bytes at most).
type Fault = (StatusCode, &'static str);

/// What is wrong with where the catheter is though its poses are new, if anything is; the worst first.
fn misplaced(snapshot: &Snapshot, is_frozen: bool) -> Option<Fault> {
    let moved = snapshot.reference_alarm.map(|_| (StatusCode::ConfigurationError, "reference moved"));
    moved.or_else(|| is_frozen.then_some((StatusCode::HardwareFailure, "poses frozen")))
}

/// What is wrong with the tissue.
fn doubtful(snapshot: &Snapshot) -> Option<Fault> {
    snapshot.deformed.doubt.map(|_| (StatusCode::UnknownError, "tissue in doubt"))
}

/// How a catheter that is known counts: what is not new any more, or not to be trusted, is out of view.
const fn tool_status(signal: Freshness, misplaced: Option<Fault>) -> ToolStatus {
    match (signal, misplaced) {
        (Freshness::Lost, _) => ToolStatus::Missing,
        (Freshness::Live, None) => ToolStatus::Ok,
        _ => ToolStatus::OutOfVolume,
    }
}

/// The catheter as a frame: its origin is the tip, its z axis leads from hub to tip; with the time of its pose.
fn catheter((needle, state): (Option<&NeedlePose>, ToolStatus), (time, id): (Option<Timestamp>, u32)) -> Message {
    let pose = needle.and_then(|n| {
        let z = Vector::new(0.0, 0.0, 1.0);
        let axis = z.cross(n.axis()).normalized().unwrap_or(Vector::new(1.0, 0.0, 0.0));
        let at = n.tip() - Point::ORIGIN;
        let patient_from_catheter = Rigid::<Patient, Tool>::from_axis_angle(axis, z.angle(n.axis()), at)?;
        Some(ras_from_patient().after(&patient_from_catheter))
    });
    let matrix = pose.as_ref().map_or(AWAY, Matrix34::from_rigid::<Ras, Tool>);
    let state = pose.map_or(ToolStatus::Missing, |_| state);
    Message::v2("Catheter", time, id, Content::Transform(matrix)).with("TransformStatus", state.value())
}

fn status(snapshot: &Snapshot, misplaced: Option<Fault>, message: String) -> Status {
    let (code, name) = match (snapshot.signal, snapshot.phase) {
        (Freshness::Lost, _) => (StatusCode::TimeOut, "lost"),
        (_, phase) if phase != Phase::Navigating => (StatusCode::NotReady, "not navigating"),
        (Freshness::Stale, _) => (StatusCode::TimeOut, "stale"),
        (Freshness::Live, _) => misplaced.or_else(|| doubtful(snapshot)).unwrap_or((StatusCode::Ok, "live")),
    };
    Status { code, sub_code: 0, name: name.to_owned(), message }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;
    use monro_guidance::reference::Bump;
    use monro_session::live::{Deformed, Doubt, Expiry, Session, ToolNames};
    use monro_wire::openigtlink::patient_of;

    #[test]
    fn the_catheters_frame_has_its_tip_and_its_direction_in_ras() {
        let needle = NeedlePose::new(Point::new(10.0, 20.0, 30.0), Vector::new(0.6, 0.0, -0.8)).expect("needle");
        let message = catheter((Some(&needle), tool_status(Freshness::Live, None)), (measured(Some(0.5)), 1));
        assert_eq!(message.meta("TransformStatus"), Some("OK"));
        let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_secs_f64();
        let age = now - message.time.expect("a time").seconds();
        assert!((0.4..60.0).contains(&age), "{age}");
        // A tool that its tracker had just said to be missing was "OK" for half a second.
        let stale = catheter((Some(&needle), tool_status(Freshness::Stale, None)), (None, 2));
        assert_eq!((stale.meta("TransformStatus"), &stale.content), (Some("OUT_OF_VOLUME"), &message.content));
        let Content::Transform(m) = message.content else { panic!("transform") };
        assert_eq!(m.columns[3], [-10.0, -20.0, 30.0]);
        assert!(m.columns[2].iter().zip([-0.6, 0.0, -0.8]).all(|(a, b)| (a - b).abs() < 1e-6), "{m:?}");
    }

    #[test]
    fn a_lost_catheter_is_drawn_nowhere_near_the_head() {
        let message = catheter((None, tool_status(Freshness::Live, None)), (None, 2));
        assert_eq!(message.meta("TransformStatus"), Some("MISSING"));
        let Content::Transform(m) = message.content else { panic!("transform") };
        assert!(m.columns[3][2] > 5000.0, "{m:?}");
    }

    /// While navigating, with new poses.
    fn navigating() -> Snapshot {
        let session = Session::new(ToolNames::default(), Expiry::default());
        let nowhere = session.snapshot(0.0, &Arc::new(Deformed::at_rest(Point::ORIGIN, 0)));
        Snapshot { phase: Phase::Navigating, signal: Freshness::Live, ..nowhere }
    }

    /// Live and OK stood beside each of these.
    #[test]
    fn live_poses_are_not_ok_while_something_is_wrong() {
        let bump = Bump { shift: 0.1, turn: 0.03, time: 0.0 };
        let moved = Snapshot { reference_alarm: Some(bump), ..navigating() };
        let torn = Deformed { doubt: Some(Doubt::Inverted(7)), ..Deformed::at_rest(Point::ORIGIN, 0) };
        let torn = Snapshot { deformed: Arc::new(torn), ..navigating() };
        let told = |s: &Snapshot, is_frozen: bool| {
            let misplaced = misplaced(s, is_frozen);
            let said = status(s, misplaced, String::new());
            let bytes = Message::v2("Monro", None, 1, Content::Status(said.clone())).encode();
            assert!(bytes.is_ok(), "{bytes:?}");
            (said.name, said.code == StatusCode::Ok, tool_status(s.signal, misplaced).value())
        };
        assert_eq!(told(&navigating(), false), ("live".to_owned(), true, "OK"));
        for (snapshot, is_frozen, name, catheter) in [
            (moved.clone(), true, "reference moved", "OUT_OF_VOLUME"),
            (navigating(), true, "poses frozen", "OUT_OF_VOLUME"),
            // Where the catheter is does not hang on the tissue.
            (torn, false, "tissue in doubt", "OK"),
        ] {
            assert_eq!(told(&snapshot, is_frozen), (name.to_owned(), false, catheter));
        }
        let lost = Snapshot { signal: Freshness::Lost, ..moved };
        assert_eq!(told(&lost, false), ("lost".to_owned(), false, "MISSING"));
    }

    #[test]
    fn a_thinned_image_has_its_voxels_where_the_ct_has_them() {
        let grid = Grid::axis_aligned([5, 4, 3], [1.0, 2.0, 3.0], [10.0, 20.0, 30.0]).expect("grid");
        let volume = Volume::new(grid, (0..60).collect()).expect("volume");
        let image = image(&volume, [2, 1, 1]).expect("image");
        assert_eq!((image.size, image.pixels.len()), ([3, 4, 3], 72));
        assert_eq!(image.first_voxel(), ras_of(Point::<Patient>::new(10.0, 20.0, 30.0)));
        assert_eq!(i16::from_le_bytes([image.pixels[2], image.pixels[3]]), 2);
        let far = core::array::from_fn(|c| image.first_voxel()[c] + 2.0 * image.axes[0][c]);
        assert!(patient_of(far).distance(Point::new(14.0, 20.0, 30.0)) < 1e-5);
    }
}
