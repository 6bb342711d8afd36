//! Catheters of any thickness that come askew upon a ventricle in elements of many shapes, and go out again: each wall is
//! gone through once. Scenes that went wrong among some hundred made at random.

mod common;

use common::{cube_with_horn, options, physical};
use monro_geometry::{Point, Vector};
use monro_tissue::{Event, FrameSettings, Insertion, Material, Model, Stepper, TipShape, Tool, ToolMotion, ToolPose};

/// Edge of the cube, mm.
const EDGE: f64 = 48.0;

/// A way into a cube of brain with a horn of a ventricle along y in its middle.
struct Way {
    /// Cells along an edge, and by which share of one their corners are displaced.
    cells: usize,
    skew: f64,
    /// Radius and height of the horn, mm.
    horn: [f64; 2],
    /// Force and dimple at which its wall yields, mN and mm.
    yields: [f64; 2],
    /// Tangent of the angle to the vertical, and to where, radians.
    tilt: [f64; 2],
    /// A point of the way at the horn's height, mm; how far beyond that it goes.
    aim: [f64; 2],
    deep: f64,
    radius_mm: f64,
    mm_s: f64,
}

fn cube(way: &Way) -> Model {
    let (mesh, fixed) = cube_with_horn(EDGE, (way.cells, way.skew), way.horn);
    let mut options = options(physical(), &fixed);
    let [puncture_force_mn, puncture_depth_mm] = way.yields;
    let insertion = Insertion { puncture_force_mn, puncture_depth_mm, ..Insertion::VENTRICLE };
    options.materials.insert(5, Material { insertion, ..Material::VENTRICLE });
    Model::new(&mesh, &options).expect("model")
}

/// In, half a second's rest, and out: labels of the walls gone through on the way in and after it, and where the tip ends.
fn go(way: &Way) -> ([Vec<u16>; 2], Option<u16>) {
    let model = cube(way);
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let [tilt, turn] = way.tilt;
    let back = Vector::new(tilt * turn.cos(), tilt * turn.sin(), 1.0).normalized().expect("a direction");
    let start = (EDGE + 3.0 - way.horn[1]) / back.z;
    let frames = ((start + way.deep) / way.mm_s * 60.0).ceil() as i32;
    let pose = |f: i32| {
        let gone = f64::from(f.min(frames).min(2 * frames + 30 - f)) * way.mm_s / 60.0;
        let tip = Point::new(way.aim[0], way.aim[1], way.horn[1]) + back * (start - gone.min(start + way.deep));
        ToolPose { tip, tail: tip + back * 120.0 }
    };
    let tool = Tool { tip: TipShape::Round, radius_mm: way.radius_mm };
    let (mut through, mut last) = ([Vec::new(), Vec::new()], None);
    for f in 0..2 * frames + 30 {
        let motion = ToolMotion { tool, from: pose(f), to: pose(f + 1) };
        let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
        let punctured = report.events.iter().filter_map(|e| match e {
            Event::Punctured { to, .. } => Some(*to),
            _ => None,
        });
        through[usize::from(f >= frames)].extend(punctured);
        last = report.tools[0].label;
    }
    (through, last)
}

/// The faces around the hole pushed on it as if they were walls at its side, by more than a newton, and it went through these.
#[test]
fn a_thick_catheter_is_not_pushed_by_the_faces_around_its_hole() {
    let way = Way {
        cells: 10,
        skew: 0.15052584160240068,
        horn: [8.869510202462198, 25.27080636990275],
        yields: [120.0, 4.0],
        tilt: [0.12987069990746838, 3.943595345108711],
        aim: [20.07390863257787, 24.680408252953214],
        deep: 3.215165162057767,
        radius_mm: 2.279953955575807,
        mm_s: 25.231472028302154,
    };
    assert_eq!(go(&way), ([vec![4, 5], vec![]], None));
}

/// On its way out it pressed on the surface around it, which yielded: it was in the brain ever after.
#[test]
fn a_catheter_drawn_out_askew_is_outside() {
    let thick = Way {
        cells: 12,
        skew: 0.0,
        horn: [8.08745165423161, 21.039953850580048],
        yields: [29.039732862156242, 2.8808240708891297],
        tilt: [0.8399725776009792, 1.7993064641076975],
        aim: [22.723323407877775, 27.8534217931435],
        deep: 10.908610647459607,
        radius_mm: 2.185637795507854,
        mm_s: 63.334805924186064,
    };
    let thin = Way {
        cells: 7,
        horn: [6.770444700939297, 21.440270491957577],
        yields: [53.15515380980239, 5.6245591675914985],
        tilt: [0.8865739470703011, 5.0515187833860065],
        aim: [22.210128383108646, 23.142681899220236],
        deep: 9.758379509293764,
        radius_mm: 0.7623995352608675,
        mm_s: 28.430356684642714,
        ..thick
    };
    for way in [thick, thin] {
        assert_eq!(go(&way), ([vec![4, 5], vec![]], None), "radius {} mm", way.radius_mm);
    }
}
