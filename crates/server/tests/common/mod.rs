//! A small made-up head as a case folder, and a bare HTTP client.

#![allow(dead_code, unreachable_pub, reason = "each test and example uses its own part")]

use monro_case::markups::NamedPoint;
use monro_case::{CASE, Case, CaseFiles, Manifest, SCHEMA, Source, Staging};
use monro_geometry::{Grid, Patient, Point, TetMesh, TriangleMesh, Vector, Volume};
use monro_guidance::{Plan, Side};
use monro_server::{ServeOptions, Tracker};
use monro_session::{FrameSettings, Mode, ModelSettings, Skull};
use monro_tissue::{PaperOptions, PhysicalOptions};
use std::path::{Path, PathBuf};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;

const CELLS: usize = 10;
/// Half axes of the brain, mm.
const BRAIN_MM: [f64; 3] = [65.0, 82.0, 62.0];
/// Skin and skull as multiples of the brain.
const SKIN: f64 = 1.2;
const SKULL: [f64; 2] = [1.04, 1.13];
/// Half axes of a lateral ventricle, and its middle on the patient's left, mm.
const VENTRICLE_MM: [f64; 3] = [9.0, 30.0, 12.0];
const VENTRICLE_AT: [f64; 3] = [11.0, -6.0, 8.0];

fn ellipsoid(p: [f64; 3], axes: [f64; 3]) -> f64 {
    (0..3).map(|a| (p[a] / axes[a]).powi(2)).sum::<f64>().sqrt()
}

/// 5 or 6 in a lateral ventricle, else 4.
fn label(p: [f64; 3]) -> u16 {
    let inside = |side: f64| {
        ellipsoid([p[0] - side * VENTRICLE_AT[0], p[1] - VENTRICLE_AT[1], p[2] - VENTRICLE_AT[2]], VENTRICLE_MM) < 1.0
    };
    match (inside(1.0), inside(-1.0)) {
        (true, _) => 5,
        (_, true) => 6,
        _ => 4,
    }
}

/// A block of cubes of six tetrahedra each, rounded into an ellipsoid.
pub fn brain() -> TetMesh {
    const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let n = CELLS + 1;
    let mut mesh = TetMesh::default();
    for c in 0..n * n * n {
        let unit = [c % n, c / n % n, c / n / n].map(|i| 2.0 * i as f64 / CELLS as f64 - 1.0);
        let (largest, length) = (unit.iter().fold(0f64, |m, v| m.max(v.abs())), ellipsoid(unit, [1.0; 3]));
        // Most of the way from the cube to the ball: all of it would flatten the elements at the cube's edges.
        let shrink = if length > 0.0 { 0.1 + 0.9 * largest / length } else { 1.0 };
        mesh.vertices.push(Point::from_array(core::array::from_fn(|a| unit[a] * shrink * BRAIN_MM[a])));
    }
    for c in 0..CELLS.pow(3) {
        for (turn, path) in PATHS.iter().enumerate() {
            let mut at = [c % CELLS, c / CELLS % CELLS, c / CELLS / CELLS];
            let mut tet = [0; 4];
            for (k, t) in tet.iter_mut().enumerate() {
                *t = (at[0] + n * (at[1] + n * at[2])) as u32;
                if k < 3 {
                    at[path[k]] += 1;
                }
            }
            if turn >= 3 {
                tet.swap(1, 2);
            }
            let corners = tet.map(|v| mesh.vertices[v as usize].to_array());
            mesh.labels.push(label(core::array::from_fn(|a| corners.iter().map(|p| p[a]).sum::<f64>() / 4.0)));
            mesh.tets.push(tet);
        }
    }
    mesh
}

fn ct() -> Volume<i16> {
    let grid = Grid::axis_aligned([64, 80, 60], [2.6; 3], [-82.0, -103.0, -77.0]).expect("grid");
    let hu = |p: Point<Patient>| match ellipsoid(p.to_array(), BRAIN_MM) {
        r if r > SKIN => -1000,
        r if r > SKULL[1] => 40,
        r if r > SKULL[0] => 900,
        r if r > 1.0 => 8,
        _ if label(p.to_array()) == 4 => 36,
        _ => 6,
    };
    let data = (0..grid.len()).map(|i| grid.voxel(i)).map(|[i, j, k]| hu(grid.centre(i, j, k))).collect();
    Volume::new(grid, data).expect("volume")
}

fn scaled(mesh: &TriangleMesh, factor: f64) -> TriangleMesh {
    let vertices = mesh.vertices.iter().map(|p| Point::ORIGIN + (*p - Point::ORIGIN) * factor).collect();
    TriangleMesh { vertices, triangles: mesh.triangles.clone() }
}

fn plan() -> Plan {
    let target = Point::new(-9.0, -14.0, 8.0);
    let up = Vector::new(-0.35, -0.45, 0.82).normalized().expect("direction");
    let outside = |t: &f64| ellipsoid((target + up * *t).to_array(), BRAIN_MM) > SKIN;
    let length = (0..1200).map(|i| f64::from(i) * 0.1).find(outside).expect("out of the head");
    Plan::new(Side::Right, target + up * length, target).expect("plan")
}

/// Places on the skin, and one inside, which cannot be touched.
fn landmarks(skin: &TriangleMesh) -> Vec<NamedPoint> {
    let farthest = |towards: [f64; 3]| {
        let along = |p: &Point<Patient>| (*p - Point::ORIGIN).dot(Vector::from_array(towards));
        *skin.vertices.iter().max_by(|a, b| along(a).total_cmp(&along(b))).expect("a skin")
    };
    let places = [
        ("nasion", farthest([0.0, -1.0, 0.0])),
        ("Kocher left", farthest([0.3, -0.6, 0.74])),
        ("Kocher right", farthest([-0.3, -0.6, 0.74])),
        ("vertex", farthest([0.0, 0.1, 1.0])),
        ("Monro right", plan().target()),
    ];
    places.map(|(label, position)| NamedPoint { label: label.into(), position }).to_vec()
}

pub fn case() -> Case {
    let tets = brain();
    tets.validate().expect("a valid mesh");
    let surface = tets.surface(|_| true);
    let skin = scaled(&surface, SKIN);
    let (format, series) = ("phantom".into(), "made up".into());
    let manifest = Manifest {
        schema: SCHEMA,
        generator: "server tests".into(),
        notice: "Research software. Not for clinical use.".into(),
        pseudonym: "ELLIPSOID-1".into(),
        side: "right".into(),
        skull_angle_deg: Some(85.0),
        source: Source { format, series, dims: [64, 80, 60], spacing_mm: [2.6; 3] },
        findings: Vec::new(),
        scan_findings: 0,
        elements: None,
        confidence: Vec::new(),
        doubts: Vec::new(),
        files: Vec::new(),
    };
    Case {
        manifest,
        plan: plan(),
        landmarks: landmarks(&skin),
        skin,
        ventricles: tets.surface(|l| l != 4),
        brain: surface,
        septa: None,
        tets,
    }
}

/// Writes the case into a new folder below `dir`.
pub fn write_case(dir: &Path, with_ct: bool) -> PathBuf {
    let staging = Staging::begin(&dir.join("case"), false, &CASE, &[]).expect("begin");
    let images = CaseFiles { ct: with_ct.then(|| monro_scan::nifti::encode_i16(&ct())), labels: None };
    case().write(&staging, images).expect("write");
    staging.finish().expect("finish")
}

pub fn options(case_dir: PathBuf) -> ServeOptions {
    ServeOptions {
        case_dir,
        listen: "127.0.0.1:0".parse().expect("address"),
        certificate: None,
        names: Vec::new(),
        tracker: Tracker::Sim,
        model: ModelSettings::of(Mode::Paper(PaperOptions::default())),
        frame: FrameSettings::default(),
        recording: None,
        igtl: None,
    }
}

/// A soft body with units, which slides along the skull.
pub fn sliding() -> ModelSettings {
    let physical = ModelSettings::of(Mode::Physical(PhysicalOptions::default()));
    ModelSettings { skull: Skull::Slides { septa: true }, ..physical }
}

/// Status, headers, body of one request with exactly these headers.
pub async fn request(address: &str, head: &str, body: &str) -> (u16, String, Vec<u8>) {
    exchange(TcpStream::connect(address).await.expect("connect"), head, body).await
}

/// The same over any stream.
pub async fn exchange(
    mut stream: impl AsyncRead + AsyncWrite + Unpin,
    head: &str,
    body: &str,
) -> (u16, String, Vec<u8>) {
    let text = format!("{head}\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}", body.len());
    stream.write_all(text.as_bytes()).await.expect("send");
    let mut all = Vec::new();
    // A server may close without the good-bye of TLS.
    let _ = stream.read_to_end(&mut all).await;
    let end = all.windows(4).position(|w| w == b"\r\n\r\n").expect("a head");
    let headers = String::from_utf8_lossy(&all[..end]).into_owned();
    let status = headers.split(' ').nth(1).and_then(|s| s.parse().ok()).expect("a status");
    (status, headers, all.split_off(end + 4))
}
