//! The vertices of a part, sixteen at a time, each with the elements and neighbours around it.

use super::around::RowRegions;
use super::elastic::Elastic;
use super::slivers::most_beyond;
use super::strips::{self, Spoke, Step};
use crate::bytes;
use crate::fast::{Line, Places, Row, WIDTH};
use crate::slabs::{Round, Slabs, ends};
use monro_geometry::by_point;

/// Unfinished batches that are looked through for a place: many fill well, few keep the vertices of a batch near each other.
const OPEN: usize = 16;
/// Bits of all of them.
const ALL: u64 = (1 << OPEN) - 1;
/// Vertices side by side that are sorted by how many elements they have.
const NEIGHBOURHOOD: usize = 192;

/// The other three corners as seen from each corner of a positive tetrahedron, so that `(b - a) x (c - a)` is six times the
/// gradient of the volume.
const OTHERS: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// Up to sixteen vertices that are no neighbours.
#[derive(Debug, Clone, Default)]
pub(super) struct Batch {
    /// Numbers in the model; an empty lane repeats the first.
    pub(super) vertices: [u32; WIDTH],
    pub(super) count: usize,
    /// Rows of the steps around them; the first two complete no element.
    pub(super) steps: core::ops::Range<usize>,
    /// Row of the element of the third step.
    pub(super) elements: usize,
}

impl Batch {
    /// Rows of the elements that its steps complete.
    pub(super) fn rows(&self) -> core::ops::Range<usize> {
        self.elements..self.elements + self.steps.len().saturating_sub(2)
    }
}

/// Vertices whose elements all lie within one part.
#[derive(Debug, Clone, Default)]
pub(super) struct Part {
    pub(super) batches: Vec<Batch>,
    /// Each batch's own vertices.
    pub(super) own: Places<1>,
    /// Steps of the walk around each vertex (an empty place repeats the vertex): the next vertex, its weight in the shear
    /// matrix where it comes first (mN/mm), and bits of the lanes that keep the first vertex of the edge.
    pub(super) ring: Places<1>,
    pub(super) weight: Vec<Line>,
    pub(super) keeps_first: Vec<u16>,
    /// Elements that the steps complete, or one more than all.
    pub(super) tets: Places<1, u32>,
    /// Regions of these rows.
    pub(super) regions: Vec<RowRegions>,
    /// Of each batch: masses, kg; diagonal of the shear matrix, mN/mm.
    pub(super) mass: Vec<Row>,
    pub(super) diagonal: Vec<Row>,
    /// Of each batch: how many times as far as to its minimum each vertex may go.
    pub(super) most: Vec<Row>,
}

impl Part {
    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        let places = self.own.bytes() + self.ring.bytes() + self.tets.bytes();
        let rows = bytes::of(&self.weight) + bytes::of(&self.mass) + bytes::of(&self.diagonal) + bytes::of(&self.most);
        places + rows + bytes::of(&self.keeps_first) + bytes::of(&self.regions) + bytes::of(&self.batches)
    }
}

/// Everything about all vertices.
struct Rings<'a> {
    elastic: &'a Elastic,
    mass: &'a [f32],
    /// Region of each element.
    region: &'a [u8],
    start: Vec<u32>,
    around: Vec<Spoke>,
    walks: Vec<Vec<Step>>,
    /// How many times as far as to its minimum each vertex may go.
    most: Vec<f32>,
}

/// The free vertices by part: two rounds of parts that can be done at the same time.
pub(super) fn rounds(
    elastic: &Elastic,
    (rest, region): (&[[f32; 4]], &[u8]),
    mass: &[f32],
    slabs: &Slabs,
) -> [(Round, Vec<Part>); 2] {
    let (start, around) = around(&elastic.tets, rest.len());
    let mut rings = Rings { elastic, mass, region, start, around, walks: Vec::new(), most: most_beyond(elastic) };
    let free = |v: u32| rest[v as usize][3] > 0.0;
    let walk = |v: u32| if free(v) { strips::walk(rings.of(v)) } else { Vec::new() };
    rings.walks = (0..rest.len() as u32).map(walk).collect();
    let moving: Vec<u32> = (0..rest.len() as u32).filter(|&v| free(v)).collect();
    let item = |&v: &u32| {
        let ring = rings.of(v).iter().flat_map(|s| s.1).chain([v]);
        let (low, high) = ends(ring);
        (low, high, rings.walks[v as usize].len())
    };
    let shares = slabs.shares(&moving.iter().map(item).collect::<Vec<_>>());
    let mut owned = vec![Vec::new(); slabs.len()];
    moving.iter().zip(shares).for_each(|(&v, share)| owned[share].push(v));
    let [even, odd] = slabs.rounds();
    let parts = |round: &Round, first: usize| {
        let own = owned.iter().skip(first).step_by(2).take(round.parts()).enumerate();
        own.map(|(i, own)| rings.part(own, &rest[round.cuts[i]..round.cuts[i + 1]], round.cuts[i])).collect::<Vec<_>>()
    };
    let (even_parts, odd_parts) = (parts(&even, 0), parts(&odd, 1));
    [(even, even_parts), (odd, odd_parts)]
}

impl Rings<'_> {
    fn of(&self, v: u32) -> &[Spoke] {
        &self.around[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }

    /// Batches of vertices that are no neighbours; those with as many steps side by side leave few empty places.
    fn groups(&self, own: &[u32], first: usize, vertices: usize) -> Vec<Vec<u32>> {
        let mut own = own.to_vec();
        own.chunks_mut(NEIGHBOURHOOD)
            .for_each(|c| c.sort_by_key(|&v| (core::cmp::Reverse(self.walks[v as usize].len()), v)));
        // Bit `g` of a vertex: it is in open group `g` or next to one that is.
        let mut near = vec![0u64; vertices];
        let mut open: Vec<Vec<u32>> = vec![Vec::new(); OPEN];
        let mut done = Vec::new();
        let ring = |v: u32| self.of(v).iter().flat_map(|s| s.1).chain([v]).map(move |n| n as usize - first);
        let mut finish = |group: &mut Vec<u32>, near: &mut [u64], g: usize| {
            group.iter().for_each(|&v| ring(v).for_each(|n| near[n] &= !(1 << g)));
            done.push(core::mem::take(group));
        };
        for v in own {
            if near[v as usize - first] == ALL {
                let fullest = (0..OPEN).max_by_key(|&g| (open[g].len(), core::cmp::Reverse(g))).unwrap_or(0);
                finish(&mut open[fullest], &mut near, fullest);
            }
            let g = (!near[v as usize - first]).trailing_zeros() as usize;
            open[g].push(v);
            ring(v).for_each(|n| near[n] |= 1 << g);
            if open[g].len() == WIDTH {
                finish(&mut open[g], &mut near, g);
            }
        }
        done.extend(open.into_iter().filter(|g| !g.is_empty()));
        done
    }

    fn part(&self, own: &[u32], rest: &[[f32; 4]], first: usize) -> Part {
        let local = |v: u32| (v as usize - first) as u16;
        let mut out = Part::default();
        let (mut owns, mut ring, mut tets) = (Vec::new(), Vec::new(), Vec::new());
        for group in self.groups(own, first, rest.len()) {
            let vertices: [u32; WIDTH] = core::array::from_fn(|l| group[if l < group.len() { l } else { 0 }]);
            let (first_step, elements) = (ring.len(), tets.len());
            for k in 0..group.iter().map(|&v| self.walks[v as usize].len()).max().unwrap_or(0) {
                let steps = vertices.map(|v| self.walks[v as usize].get(k));
                let vertex = |l: usize| steps[l].map_or(vertices[l], |s| s.vertex);
                ring.push([core::array::from_fn(|l| local(vertex(l)))]);
                out.weight.push(Line(core::array::from_fn(|l| self.weight(vertices[l], k))));
                let bit = |l: usize| u16::from(steps[l].is_none_or(|s| s.keeps_first)) << l;
                out.keeps_first.push((0..WIDTH).map(bit).sum());
                if k >= 2 {
                    let none = self.elastic.tets.len() as u32;
                    tets.push([steps.map(|s| s.and_then(|s| s.element).unwrap_or(none))]);
                }
            }
            owns.push([vertices.map(local)]);
            out.mass.push(vertices.map(|v| self.mass[v as usize]));
            out.diagonal.push(vertices.map(|v| self.elastic.near.diagonal(v as usize) as f32));
            out.most.push(vertices.map(|v| self.most[v as usize]));
            out.batches.push(Batch { vertices, count: group.len(), steps: first_step..ring.len(), elements });
        }
        // They stay as long as the model: nothing is kept free.
        ring.shrink_to_fit();
        tets.shrink_to_fit();
        out.weight.shrink_to_fit();
        out.keeps_first.shrink_to_fit();
        out.batches.shrink_to_fit();
        out.own = Places::new(owns);
        out.ring = Places::new(ring);
        out.regions = tets.iter().map(|[row]| RowRegions::of(row, self.region)).collect();
        out.tets = Places::new(tets);
        out
    }

    /// Weight of the vertex of step `k` around `v`, where it comes first.
    fn weight(&self, v: u32, k: usize) -> f32 {
        let Some((step, before)) = self.walks[v as usize].get(..=k).and_then(|w| w.split_last()) else { return 0.0 };
        if before.iter().any(|b| b.vertex == step.vertex) {
            return 0.0;
        }
        let near = &self.elastic.near;
        let mut row = near.start[v as usize] as usize..near.start[v as usize + 1] as usize;
        row.find(|&k| near.column[k] == step.vertex).map_or(0.0, |k| near.weight[k] as f32)
    }
}

/// Start of each vertex's elements, and those in order.
fn around(tets: &[[u32; 4]], nodes: usize) -> (Vec<u32>, Vec<Spoke>) {
    let spokes = (0..).zip(tets).flat_map(|(t, tet)| (0..4).map(move |c| (tet[c], (t, OTHERS[c].map(|k| tet[k])))));
    by_point(spokes, nodes)
}
