//! Falx and tentorium, about where an average head has them.
//!
//! A plain CT shows them in places only, so nothing is sought there: the free edge of the falx and the height of the tentorium are
//! those of a template averaged from 130 heads (between the labels of its two hemispheres, and of its cerebellum and what lies above;
//! Muschelli, "A publicly available, high resolution, unbiased CT brain template", 2020), carried over by the foramina of Monro,
//! the midplane and the outline of the skull in it, and stretched to the room in the skull, in each direction by itself. They end where
//! the labels have no more brain or fluid, and the falx keeps away from the ventricles.

use super::LandmarkError;
use super::surroundings::Surroundings;
use crate::segment::Segmentation;
use monro_geometry::{Patient, Plane, Point, Structure, TriangleMesh, Vector};

/// The room in the template's skull from the middle of the foramina, mm: to a side, to the front, back and top.
const TEMPLATE: [f64; 4] = [63.2, 67.5, 97.5, 65.5];
/// A direction stretches by at most this times more or less than the middle one: where the scan is cut the room is not known.
const UNEVEN: f64 = 1.15;

/// The room beside the midplane from the foramina on, over its median: from 40 degrees below straight ahead over the top to 20 below
/// straight back, each 5 degrees; the mean of three heads (which differ from it by 1 degree at most, and by 2 % of the median).
const OUTLINE: [f64; 49] = [
    0.82, 0.88, 0.94, 0.97, 0.98, 0.99, 0.99, 0.99, 1.01, 0.98, 0.98, 0.97, 0.96, 0.94, 0.92, 0.92, 0.92, 0.90, 0.89,
    0.89, 0.89, 0.87, 0.88, 0.90, 0.91, 0.94, 0.96, 0.97, 1.00, 1.03, 1.06, 1.09, 1.12, 1.14, 1.16, 1.19, 1.20, 1.22,
    1.25, 1.27, 1.31, 1.34, 1.38, 1.41, 1.42, 1.40, 1.38, 1.37, 1.42,
];
const OUTLINE_FROM: f64 = -40.0;
const OUTLINE_STEP: f64 = 5.0;
/// The head is nodded by so many degrees at most against what its ventricles say (large ones are up to 15 off).
const MOST_NOD: f64 = 25.0;
/// Standard deviations: of the outline between heads, over its median, with so many neighbouring directions alike, and of what
/// ventricles say of the nod, degrees.
const OFF: f64 = 0.03;
const ALIKE: f64 = 6.0;
const NOD: f64 = 8.0;
/// Directions in which the outline is off by more than this share of its median (the scan is cut there) count as if by this.
const MOST_OFF: f64 = 0.12;

/// The free edge of the falx, from the crista galli over the corpus callosum to where it meets the tentorium: mm posterior and superior
/// of the foramina.
const FREE_EDGE: [[f64; 2]; 11] = [
    [-62.0, -22.0],
    [-56.0, -6.0],
    [-50.0, 8.0],
    [-40.0, 20.0],
    [-25.0, 29.0],
    [-8.0, 34.0],
    [10.0, 36.0],
    [25.0, 32.0],
    [36.0, 24.0],
    [43.0, 10.0],
    [46.0, -2.0],
];

/// Where the tentorium begins, mm lateral and posterior: the notch around the brain stem, then the ridge of the petrous bone.
const FRONT_EDGE: [[f64; 2]; 9] = [
    [0.0, 46.0],
    [8.0, 42.0],
    [12.0, 34.0],
    [16.0, 30.0],
    [28.0, 30.0],
    [32.0, 34.0],
    [40.0, 38.0],
    [52.0, 46.0],
    [64.0, 54.0],
];

/// Height of the tentorium, mm superior of the foramina: rows [`HEIGHT_FROM`] and each 8 mm further back, columns in the midplane and
/// each 10 mm further aside.
const HEIGHT: [[f64; 7]; 9] = [
    [-10.0, -18.0, -24.0, -31.0, -34.0, -36.0, -38.0],
    [-6.0, -12.5, -21.0, -27.5, -31.0, -34.0, -37.0],
    [-2.0, -10.8, -18.2, -23.8, -26.8, -29.8, -32.8],
    [-4.0, -11.2, -16.8, -21.5, -24.0, -26.0, -28.0],
    [-10.0, -13.3, -16.8, -20.7, -22.0, -22.5, -23.0],
    [-16.0, -16.7, -17.8, -20.6, -22.8, -24.0, -25.0],
    [-21.0, -19.8, -20.8, -22.2, -24.0, -25.0, -26.0],
    [-25.0, -23.0, -23.0, -24.5, -26.0, -27.0, -28.0],
    [-29.0, -26.0, -25.0, -26.0, -28.0, -30.0, -31.0],
];
const HEIGHT_FROM: f64 = 30.0;
const HEIGHT_STEP: [f64; 2] = [8.0, 10.0];

/// Corpus callosum and a gap lie between ventricles and falx, mm.
const ABOVE_VENTRICLES: f64 = 8.0;
/// Ventricles as far aside as this lie under the falx, mm.
const NEAR_MIDPLANE: f64 = 8.0;
/// Distance between columns of the surfaces, mm, their number of points, and how long they are at least, mm.
const COLUMNS: f64 = 2.5;
const ROWS: usize = 25;
const LEAST: f64 = 5.0;
/// What is not inside of the skull over this length and less does not end a column, mm: a falx may have lime in it.
const SPECK: f64 = 4.0;
/// Beyond this nothing is sought, mm.
const FAR: f64 = 140.0;

/// The falx and the tentorium of a segmented head as open surfaces, LPS mm, about where an average head has them; without triangles
/// where the labels show nothing of the inside of the skull there.
///
/// # Errors
/// [`LandmarkError::NoBearings`]: no brain or no lateral ventricle in the labels.
pub fn septa(segmentation: &Segmentation) -> Result<[TriangleMesh; 2], LandmarkError> {
    let surroundings = Surroundings::new(&segmentation.labels, segmentation.midsagittal)?;
    let room = Room::new(&surroundings);
    let [aside, front, back, _] = room.stretch;
    let [front, back] = [front * FREE_EDGE[0][0], back * TEMPLATE[2]];
    let falx = room.sheet([front, back], |b| room.falx(b));
    let tentorium = room.sheet([-aside * TEMPLATE[0], aside * TEMPLATE[0]], |l| room.tentorium(l));
    Ok([falx, tentorium])
}

/// The inside of the skull, measured from the middle of the foramina in the midplane: mm lateral (to the left), posterior, superior.
struct Room<'a> {
    surroundings: &'a Surroundings<'a>,
    origin: Point<Patient>,
    axes: [Vector<Patient>; 3],
    /// Of this head over the template: to a side, to the front, back and top.
    stretch: [f64; 4],
}

/// A line of points, mm in the axes of [`Room`].
type Column = Vec<[f64; 3]>;

impl<'a> Room<'a> {
    fn new(surroundings: &'a Surroundings<'a>) -> Self {
        let Plane { normal, .. } = surroundings.midsagittal;
        let [back, up] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|m| surroundings.pose.direction(m));
        let axes = [normal, back, up];
        let mut room = Self { surroundings, origin: surroundings.origin(), axes, stretch: [1.0; 4] };
        let (sin, cos) = room.nod().sin_cos();
        room.axes = [normal, back * cos + up * sin, up * cos - back * sin];
        let spread = |low: i32, high: i32| (low..=high).step_by(10).map(f64::from).collect::<Vec<_>>();
        let (level, over, beside) = (spread(-10, 30), spread(-20, 40), spread(0, 60));
        let aside = |side: f64| room.reach([side, 0.0, 0.0], &beside, |b| [0.0, b, 0.0]);
        let reach = [
            0.5 * (aside(1.0) + aside(-1.0)),
            room.reach([0.0, -1.0, 0.0], &level, |u| [NEAR_MIDPLANE, 0.0, u]),
            room.reach([0.0, 1.0, 0.0], &level, |u| [NEAR_MIDPLANE, 0.0, u]),
            room.reach([0.0, 0.0, 1.0], &over, |b| [NEAR_MIDPLANE, b, 0.0]),
        ];
        let each: [f64; 4] = core::array::from_fn(|i| reach[i] / TEMPLATE[i]);
        let mut sorted = each;
        sorted.sort_by(f64::total_cmp);
        let middle = 0.5 * (sorted[1] + sorted[2]);
        room.stretch = each.map(|s| s.clamp(middle / UNEVEN, middle * UNEVEN));
        room
    }

    /// By how much the outline of the inside of the skull in the midplane is turned against that of other heads, radians: what lies
    /// behind lies higher. Ventricles, which say so first, have shapes of their own.
    fn nod(&self) -> f64 {
        let steps = (MOST_NOD / OUTLINE_STEP) as usize;
        let count = OUTLINE.len() + 2 * steps;
        let degrees = |n: usize| OUTLINE_FROM + (n as f64 - steps as f64) * OUTLINE_STEP;
        let reach: Vec<f64> = (0..count).map(|n| self.outline(degrees(n).to_radians())).collect();
        let off = |shift: f64| {
            let here = |n: usize| mixed(count, n as f64 + steps as f64 + shift, |i| reach[i]);
            let mut ratios: Vec<f64> = (0..OUTLINE.len()).map(|n| here(n) / OUTLINE[n]).collect();
            ratios.sort_by(f64::total_cmp);
            let scale = ratios[ratios.len() / 2].max(1.0);
            let each = |n: usize| ((here(n) / scale - OUTLINE[n]).abs().min(MOST_OFF) / OFF).powi(2);
            let outline = (0..OUTLINE.len()).map(each).sum::<f64>() / ALIKE;
            outline + (shift * OUTLINE_STEP / NOD).powi(2)
        };
        // In steps of half a degree.
        let shifts = (0..=20 * steps).map(|n| n as f64 / 10.0 - steps as f64);
        let best = shifts.map(|s| (off(s), s)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |b| b.1);
        -(best * OUTLINE_STEP).to_radians()
    }

    /// How far the inside of the skull reaches beside the midplane in a direction from straight ahead (0) over the top, mm.
    fn outline(&self, angle: f64) -> f64 {
        let way = [0.0, -angle.cos(), angle.sin()];
        let side = |lateral: f64| {
            let line = |t: f64| [lateral, t * way[1], t * way[2]];
            self.span(line, 0.0).map_or(0.0, |[_, last]| last)
        };
        0.5 * (side(NEAR_MIDPLANE) + side(-NEAR_MIDPLANE))
    }

    /// How far the inside of the skull reaches in a direction from any of some places on both sides of the midplane, mm.
    fn reach(&self, way: [f64; 3], places: &[f64], from: impl Fn(f64) -> [f64; 3]) -> f64 {
        let mm = |at: [f64; 3]| {
            let line = |t: f64| core::array::from_fn(|a| at[a] + t * way[a]);
            samples(0.0, FAR).filter(|t| self.inside(line(*t))).last().unwrap_or(0.0)
        };
        let both = places.iter().map(|p| from(*p)).flat_map(|[l, b, u]| [[l, b, u], [-l, b, u]]);
        both.map(mm).fold(0.0, f64::max)
    }

    fn structure(&self, m: [f64; 3]) -> Structure {
        self.surroundings.structure(self.place(m))
    }

    fn inside(&self, m: [f64; 3]) -> bool {
        self.structure(m).is_intracranial()
    }

    fn place(&self, m: [f64; 3]) -> Point<Patient> {
        (0..3).fold(self.origin, |p, a| p + self.axes[a] * m[a])
    }

    /// The template's mm posterior of a place.
    fn posterior(&self, back: f64) -> f64 {
        back / self.stretch[if back < 0.0 { 1 } else { 2 }]
    }

    /// Height of the tentorium there, mm.
    fn height(&self, lateral: f64, back: f64) -> f64 {
        let row = (self.posterior(back) - HEIGHT_FROM) / HEIGHT_STEP[0];
        let column = lateral.abs() / self.stretch[0] / HEIGHT_STEP[1];
        let in_row = |r: usize| mixed(HEIGHT[r].len(), column, |c| HEIGHT[r][c]);
        self.stretch[3] * mixed(HEIGHT.len(), row, in_row)
    }

    /// The falx at a place of the midplane, from its free edge (further back the tentorium) up to the skull.
    fn falx(&self, back: f64) -> Option<Column> {
        let [.., meet] = FREE_EDGE;
        let posterior = self.posterior(back);
        let low = if posterior <= meet[0] {
            let edge = self.stretch[3] * along(&FREE_EDGE, posterior);
            self.roof(back).map_or(edge, |roof| edge.max(roof + ABOVE_VENTRICLES))
        } else {
            self.height(0.0, back)
        };
        self.column(|u| [0.0, back, u], low)
    }

    /// The highest place of a ventricle near the midplane, mm.
    fn roof(&self, back: f64) -> Option<f64> {
        let near = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|s| s * NEAR_MIDPLANE);
        let any = |u: &f64| near.iter().any(|&l| self.structure([l, back, *u]).is_ventricle());
        samples(-TEMPLATE[3], FAR).filter(any).last()
    }

    /// The tentorium at a distance from the midplane, from its front edge back to the skull.
    fn tentorium(&self, lateral: f64) -> Option<Column> {
        let front = self.stretch[2] * along(&FRONT_EDGE, lateral.abs() / self.stretch[0]);
        self.column(|b| [lateral, b, self.height(lateral, b)], front)
    }

    /// What of a line from `low` on lies inside the skull, from the first place that does to the first that does not.
    fn column(&self, line: impl Fn(f64) -> [f64; 3], low: f64) -> Option<Column> {
        let [first, last] = self.span(&line, low)?;
        let at = |row: usize| line(first + (last - first) * row as f64 / (ROWS - 1) as f64);
        (last - first >= LEAST).then(|| (0..ROWS).map(at).collect())
    }

    /// The first and the last place of that.
    fn span(&self, line: impl Fn(f64) -> [f64; 3], low: f64) -> Option<[f64; 2]> {
        let mut inside = samples(low, low + FAR).skip_while(|t| !self.inside(line(*t)));
        let first = inside.next()?;
        let reached = |last: &mut f64, t: f64| {
            *last = if self.inside(line(t)) { t } else { *last };
            (t - *last <= SPECK).then_some(*last)
        };
        let last = inside.scan(first, reached).last()?;
        Some([first, last])
    }

    /// The surface through columns that stand side by side.
    fn sheet(&self, [low, high]: [f64; 2], column: impl Fn(f64) -> Option<Column>) -> TriangleMesh {
        let mut out = TriangleMesh::default();
        let count = ((high - low) / COLUMNS).ceil() as usize;
        let mut before = None;
        for n in 0..=count {
            let here = column(low + (high - low) * n as f64 / count as f64);
            let first = here.map(|points| {
                let first = out.vertices.len() as u32;
                out.vertices.extend(points.into_iter().map(|m| self.place(m)));
                first
            });
            if let (Some(a), Some(b)) = (before, first) {
                let cell = |r: u32| [[a + r, b + r, a + r + 1], [b + r, b + r + 1, a + r + 1]];
                out.triangles.extend((0..ROWS as u32 - 1).flat_map(cell));
            }
            before = first;
        }
        out
    }
}

/// Places a millimetre apart.
fn samples(low: f64, high: f64) -> impl Iterator<Item = f64> {
    (0..=(high - low) as usize).map(move |n| low + n as f64)
}

/// The value at a place between those of a row of `count`, the first or last one beyond its ends.
fn mixed(count: usize, at: f64, of: impl Fn(usize) -> f64) -> f64 {
    let at = at.clamp(0.0, (count - 1) as f64);
    let first = (at as usize).min(count - 2);
    let t = at - first as f64;
    of(first) * (1.0 - t) + of(first + 1) * t
}

/// The second coordinate of a bent line at a first one, that of its ends beyond them.
fn along(line: &[[f64; 2]], x: f64) -> f64 {
    let after = line.iter().position(|p| p[0] >= x).unwrap_or(line.len() - 1).max(1);
    let [[x0, y0], [x1, y1]] = [line[after - 1], line[after]];
    y0 + (y1 - y0) * ((x - x0) / (x1 - x0)).clamp(0.0, 1.0)
}
