//! Elements in the order in which sweeps come by them.
//!
//! A sweep meets each element once for each of its free corners. Fetched from where elements have their numbers, two
//! numbers cost as much as the vertex that completes the element; side by side along the walks they cost next to nothing.
//! They are laid out anew whenever pressures have followed, once for several sweeps.

use super::rings::Part;
use crate::bytes;
use crate::fast::{Kernel, Lanes, Line, Pool, WIDTH, widest};
use crate::slabs::Round;

/// Derivatives of the elements along the walks of all parts: at no volume (kPa/6), and by six times the volume.
#[derive(Debug, Clone, Default)]
pub(super) struct Streams {
    slope: Vec<Line>,
    rise: Vec<Line>,
}

/// The elements along the walks of one part.
#[derive(Clone, Copy, Default)]
pub(super) struct Stream<'a> {
    pub(super) slope: &'a [Line],
    pub(super) rise: &'a [Line],
}

/// No free vertex at this corner.
const NOWHERE: u32 = u32::MAX;

/// Where the elements of a model come along the walks.
#[derive(Debug, Clone, Default)]
pub(super) struct Visits {
    /// Of each element: places in the streams, one for each corner.
    places: Vec<[u32; 4]>,
    /// Rows of the streams at which the parts of both rounds begin, and the end.
    cuts: Vec<usize>,
}

impl Visits {
    /// Where parts come by so many elements.
    pub(super) fn new(rounds: &[(Round, Vec<Part>); 2], tets: usize) -> Self {
        let mut out = Self { places: vec![[NOWHERE; 4]; tets], cuts: vec![0] };
        for part in rounds.iter().flat_map(|r| &r.1) {
            let first = out.cuts[out.cuts.len() - 1];
            for batch in &part.batches {
                for row in batch.rows() {
                    for (lane, &t) in part.tets.row(row)[0][..batch.count].iter().enumerate() {
                        // Larger numbers are none.
                        let Some(places) = out.places.get_mut(t as usize) else { continue };
                        let place = places.iter_mut().find(|p| **p == NOWHERE).expect("an element has four corners");
                        *place = u32::try_from((first + row) * WIDTH + lane).expect("fewer places than numbers");
                    }
                }
            }
            out.cuts.push(first + part.tets.len());
        }
        out
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.places) + bytes::of(&self.cuts)
    }
}

impl Streams {
    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.slope) + bytes::of(&self.rise)
    }

    /// The streams of part `i` of the two rounds one after the other.
    pub(super) fn part(&self, visits: &Visits, i: usize) -> Stream<'_> {
        let own = visits.cuts[i]..visits.cuts[i + 1];
        Stream { slope: &self.slope[own.clone()], rise: &self.rise[own] }
    }

    /// Lays out the second derivatives, of each element and of one more that is nothing.
    pub(super) fn lay_rises(
        &mut self,
        (rounds, visits): (&[(Round, Vec<Part>); 2], &Visits),
        rises: &[f32],
        pool: &Pool,
    ) {
        lay(rounds, visits, rises, &mut self.rise, pool);
    }

    /// Lays out the derivatives at no volume, of each element and of one more that is nothing.
    pub(super) fn lay_slopes(
        &mut self,
        (rounds, visits): (&[(Round, Vec<Part>); 2], &Visits),
        slopes: &[f32],
        pool: &Pool,
    ) {
        lay(rounds, visits, slopes, &mut self.slope, pool);
    }

    /// The derivatives at no volume of some elements alone.
    pub(super) fn put(&mut self, visits: &Visits, elements: &[u32], slopes: &[f32]) {
        for &t in elements {
            for &place in visits.places[t as usize].iter().filter(|&&p| p != NOWHERE) {
                self.slope[place as usize / WIDTH][place as usize % WIDTH] = slopes[t as usize];
            }
        }
    }
}

fn lay(rounds: &[(Round, Vec<Part>); 2], visits: &Visits, numbers: &[f32], out: &mut Vec<Line>, pool: &Pool) {
    let [even, odd] = [&rounds[0].1, &rounds[1].1];
    let cuts = &visits.cuts[..];
    out.resize(cuts[cuts.len() - 1], Line::default());
    pool.each_part(out, cuts, &mut vec![(); cuts.len()], &|i, out, ()| {
        let part = even.get(i).unwrap_or_else(|| &odd[i - even.len()]);
        widest(Lay { part, numbers, out });
    });
}

/// Numbers of elements along the walks of a part.
struct Lay<'a> {
    part: &'a Part,
    numbers: &'a [f32],
    out: &'a mut [Line],
}

impl Kernel for Lay<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let numbers = self.part.tets.numbers(self.numbers);
        for (row, out) in self.out.iter_mut().enumerate() {
            numbers.ask_ahead(row);
            for first in (0..WIDTH).step_by(V::N) {
                numbers.gather::<V>(row, 0, first).store(out, first);
            }
        }
    }
}
