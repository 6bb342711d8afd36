//! Arithmetic on several constraints at once, written once for all widths.
//!
//! A batch has [`WIDTH`] lanes; a processor takes them 8 or 16 at a time. Nothing is reordered, and a product and a sum are
//! rounded once only where it is asked for, so every width gives the same bits, and [`Plain`] is the truth that the others
//! are held to.

use crate::bytes;
use core::ops::{Add, Div, Mul, Sub};

/// Lanes of a batch.
pub(crate) const WIDTH: usize = 16;

/// One number for each lane of a batch.
pub(crate) type Row = [f32; WIDTH];

/// A row that begins where a line of the cache does, so that it is fetched at once.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(crate) struct Line(pub(crate) Row);

impl core::ops::Deref for Line {
    type Target = Row;
    #[inline(always)]
    fn deref(&self) -> &Row {
        &self.0
    }
}

impl core::ops::DerefMut for Line {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Row {
        &mut self.0
    }
}

/// A vector of `N` lanes.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    const N: usize;
    fn splat(v: f32) -> Self;
    /// The lanes `first..first + N` of a row.
    fn load(row: &Row, first: usize) -> Self;
    /// Writes the lanes `first..first + N` of a row.
    fn store(self, row: &mut Row, first: usize);
    fn sqrt(self) -> Self;
    /// `self * factor + more`, rounded once.
    fn mul_add(self, factor: Self, more: Self) -> Self;
    /// `from - self * factor`, rounded once.
    fn mul_off(self, factor: Self, from: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    /// Where a lane is not finite, zero.
    fn or_zero(self) -> Self;
    /// `yes` where `self` is negative, `no` elsewhere.
    fn if_negative(self, yes: Self, no: Self) -> Self;
    /// `yes` where the lane's bit is set, `no` elsewhere; the first lane has the bit `first`.
    fn choose(bits: u16, first: usize, yes: Self, no: Self) -> Self;
    /// The numbers at `places`.
    ///
    /// # Safety
    /// Every place lies within the numbers behind `from`.
    unsafe fn gather_numbers<P: Place>(from: *const f32, places: &[P; WIDTH], first: usize) -> Self;
    /// Both numbers of the pairs `first..first + N`.
    fn load_pairs(pairs: &[[f32; 2]; WIDTH], first: usize) -> [Self; 2];
    /// x, y, z and inverse mass of the vertices at `places`, by component.
    ///
    /// # Safety
    /// Every place lies within the vertices behind `from`.
    unsafe fn gather<P: Place>(from: *const [f32; 4], places: &[P; WIDTH], first: usize) -> [Self; 4];
    /// Writes the first `count` vertices back.
    ///
    /// # Safety
    /// Every place lies within the vertices behind `to`, and nobody else uses them.
    unsafe fn scatter(v: [Self; 4], to: *mut [f32; 4], places: &[u16; WIDTH], first: usize, count: usize);
}

/// Scalar product.
#[inline(always)]
pub(crate) fn dot<V: Lanes>(u: [V; 3], v: [V; 3]) -> V {
    u[2].mul_add(v[2], u[1].mul_add(v[1], u[0] * v[0]))
}

/// Cross product. Of two vectors along one line it is not exactly zero: one of each two products is rounded.
#[inline(always)]
pub(crate) fn cross<V: Lanes>(u: [V; 3], v: [V; 3]) -> [V; 3] {
    let of = |a: usize, b: usize| u[b].mul_off(v[a], u[a] * v[b]);
    [of(1, 2), of(2, 0), of(0, 1)]
}

/// The sum of the square roots of the first `count` of a row.
#[inline(always)]
pub(crate) fn sum_of_roots(squares: &Row, count: usize) -> f32 {
    let roots: Row = core::array::from_fn(|l| if l < count { squares[l].sqrt() } else { 0.0 });
    // Four sums at a time: one after the other would wait for each addition.
    let sums: [f32; 4] = core::array::from_fn(|l| (roots[l] + roots[l + 4]) + (roots[l + 8] + roots[l + 12]));
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// How many rows ahead memory is asked for: what a processor does with so many takes about as long as memory does.
const AHEAD: usize = 16;

/// Asks for the row that comes [`AHEAD`] rows after row `k`. Processors foresee one stream of memory well, but not as many at
/// once as a sweep reads. Nothing happens beyond the end.
#[inline(always)]
pub(crate) fn ask_ahead<T>(rows: &[T], k: usize) {
    ask(rows.as_ptr().wrapping_add(k + AHEAD));
}

/// Asks for a line of memory that will be read soon; whether it is there does not matter.
#[inline(always)]
fn ask<T>(at: *const T) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every x86-64 processor has it, and it reads nothing that a program can see.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}

/// Work that can be done with vectors of any width.
pub(crate) trait Kernel {
    type Out;
    fn run<V: Lanes>(self) -> Self::Out;
}

/// Runs a kernel with the widest vectors that the processor has.
pub(crate) fn widest<K: Kernel>(kernel: K) -> K::Out {
    #[cfg(target_arch = "x86_64")]
    {
        use super::x86;
        // `std` remembers what the processor said.
        if x86::has_avx512() {
            return x86::with_avx512(kernel);
        }
        if x86::has_avx2() {
            return x86::with_avx2(kernel);
        }
    }
    plain(kernel)
}

/// Runs a kernel without any special instruction.
pub(crate) fn plain<K: Kernel>(kernel: K) -> K::Out {
    kernel.run::<Plain>()
}

/// A place among vertices.
pub(crate) trait Place: Copy {
    fn at(self) -> usize;
}

impl Place for u16 {
    #[inline(always)]
    fn at(self) -> usize {
        self.into()
    }
}

impl Place for u32 {
    #[inline(always)]
    fn at(self) -> usize {
        self as usize
    }
}

/// Vertices of batches of constraints on `K` vertices each, checked once so that kernels need not check them again.
#[derive(Debug, Clone, Default)]
pub(crate) struct Places<const K: usize, P = u16> {
    rows: Vec<[[P; WIDTH]; K]>,
    /// One more than the largest place.
    bound: usize,
}

impl<const K: usize, P: Place> Places<K, P> {
    pub(crate) fn new(rows: Vec<[[P; WIDTH]; K]>) -> Self {
        let bound = rows.iter().flatten().flatten().map(|p| p.at() + 1).max().unwrap_or(0);
        // Some processors count places with a sign.
        assert!(i32::try_from(bound).is_ok(), "a place beyond {}: {bound}", i32::MAX);
        Self { rows, bound }
    }

    /// Number of batches.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The places of a batch.
    pub(crate) fn row(&self, batch: usize) -> &[[P; WIDTH]; K] {
        &self.rows[batch]
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.rows)
    }

    /// The places over the vertices that they stand for.
    ///
    /// # Panics
    /// When there are fewer vertices than places.
    pub(crate) fn over<'a>(&'a self, vertices: &'a mut [[f32; 4]]) -> Window<'a, K, P> {
        assert!(self.bound <= vertices.len(), "{} places over {} vertices", self.bound, vertices.len());
        Window { rows: &self.rows, vertices }
    }

    /// The places over vertices that are only read.
    ///
    /// # Panics
    /// As [`Places::over`].
    pub(crate) fn view<'a>(&'a self, vertices: &'a [[f32; 4]]) -> View<'a, K, P> {
        assert!(self.bound <= vertices.len(), "{} places over {} vertices", self.bound, vertices.len());
        View { rows: &self.rows, vertices }
    }

    /// The places over numbers that are only read.
    ///
    /// # Panics
    /// When there are fewer numbers than places.
    pub(crate) fn numbers<'a>(&'a self, numbers: &'a [f32]) -> Numbers<'a, K, P> {
        assert!(self.bound <= numbers.len(), "{} places over {} numbers", self.bound, numbers.len());
        Numbers { rows: &self.rows, numbers }
    }
}

/// Vertices seen through checked places.
pub(crate) struct Window<'a, const K: usize, P = u16> {
    rows: &'a [[[P; WIDTH]; K]],
    vertices: &'a mut [[f32; 4]],
}

/// Vertices seen through checked places, to be read.
pub(crate) struct View<'a, const K: usize, P = u16> {
    rows: &'a [[[P; WIDTH]; K]],
    vertices: &'a [[f32; 4]],
}

/// Numbers seen through checked places, to be read.
pub(crate) struct Numbers<'a, const K: usize, P = u16> {
    rows: &'a [[[P; WIDTH]; K]],
    numbers: &'a [f32],
}

impl<const K: usize, P: Place> Numbers<'_, K, P> {
    /// Asks for the places of a batch that comes later.
    #[inline(always)]
    pub(crate) fn ask_ahead(&self, batch: usize) {
        ask_ahead(self.rows, batch);
    }

    /// Number `corner` of the lanes `first..first + V::N` of a batch.
    #[inline(always)]
    pub(crate) fn gather<V: Lanes>(&self, batch: usize, corner: usize, first: usize) -> V {
        // SAFETY: `Places::numbers` has checked all places against the count of numbers.
        unsafe { V::gather_numbers(self.numbers.as_ptr(), &self.rows[batch][corner], first) }
    }
}

impl<const K: usize> Window<'_, K> {
    /// Vertex `corner` of the lanes `first..first + V::N` of a batch.
    #[inline(always)]
    pub(crate) fn gather<V: Lanes>(&self, batch: usize, corner: usize, first: usize) -> [V; 4] {
        // SAFETY: `Places::over` has checked all places against the number of vertices.
        unsafe { V::gather(self.vertices.as_ptr(), &self.rows[batch][corner], first) }
    }

    /// Writes these vertices back; where lanes have one place, they must be the same.
    #[inline(always)]
    pub(crate) fn put<V: Lanes>(&mut self, batch: usize, corner: usize, first: usize, v: [V; 4]) {
        self.scatter(batch, corner, first, v, V::N);
    }

    /// Writes the first `count` of these vertices back.
    #[inline(always)]
    pub(crate) fn scatter<V: Lanes>(&mut self, batch: usize, corner: usize, first: usize, v: [V; 4], count: usize) {
        // SAFETY: as in `gather`, and the window holds its vertices alone.
        unsafe { V::scatter(v, self.vertices.as_mut_ptr(), &self.rows[batch][corner], first, count) };
    }
}

impl<const K: usize, P: Place> View<'_, K, P> {
    /// Vertex `corner` of the lanes `first..first + V::N` of a batch.
    #[inline(always)]
    pub(crate) fn gather<V: Lanes>(&self, batch: usize, corner: usize, first: usize) -> [V; 4] {
        // SAFETY: `Places::view` has checked all places against the number of vertices.
        unsafe { V::gather(self.vertices.as_ptr(), &self.rows[batch][corner], first) }
    }

    /// Asks for the places of a batch that comes later.
    #[inline(always)]
    pub(crate) fn ask_ahead(&self, batch: usize) {
        ask_ahead(self.rows, batch);
    }

    /// Asks for the vertices of the batch after the next.
    #[inline(always)]
    pub(crate) fn ask_next(&self, batch: usize) {
        if let Some(rows) = self.rows.get(batch + 2) {
            rows.iter().flatten().for_each(|p| ask(self.vertices.as_ptr().wrapping_add(p.at())));
        }
    }

    /// `count` batches from `first` on.
    #[inline(always)]
    pub(crate) fn part(self, first: usize, count: usize) -> Self {
        Self { rows: &self.rows[first..][..count], vertices: self.vertices }
    }
}

/// Eight lanes in plain arithmetic.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plain([f32; 8]);

macro_rules! by_lane {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Plain {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(core::array::from_fn(|l| self.0[l] $op other.0[l]))
            }
        }
    };
}
by_lane!(Add, add, +);
by_lane!(Sub, sub, -);
by_lane!(Mul, mul, *);
by_lane!(Div, div, /);

impl Lanes for Plain {
    const N: usize = 8;
    #[inline(always)]
    fn splat(v: f32) -> Self {
        Self([v; 8])
    }
    #[inline(always)]
    fn load(row: &Row, first: usize) -> Self {
        Self(core::array::from_fn(|l| row[first + l]))
    }
    #[inline(always)]
    fn store(self, row: &mut Row, first: usize) {
        row[first..first + 8].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, more: Self) -> Self {
        Self(core::array::from_fn(|l| self.0[l].mul_add(factor.0[l], more.0[l])))
    }
    #[inline(always)]
    fn mul_off(self, factor: Self, from: Self) -> Self {
        Self(core::array::from_fn(|l| (-self.0[l]).mul_add(factor.0[l], from.0[l])))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(core::array::from_fn(|l| if self.0[l] > other.0[l] { self.0[l] } else { other.0[l] }))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(core::array::from_fn(|l| if self.0[l] < other.0[l] { self.0[l] } else { other.0[l] }))
    }
    #[inline(always)]
    fn or_zero(self) -> Self {
        Self(self.0.map(|v| if v.is_finite() { v } else { 0.0 }))
    }
    #[inline(always)]
    fn if_negative(self, yes: Self, no: Self) -> Self {
        Self(core::array::from_fn(|l| if self.0[l] < 0.0 { yes.0[l] } else { no.0[l] }))
    }
    #[inline(always)]
    fn choose(bits: u16, first: usize, yes: Self, no: Self) -> Self {
        Self(core::array::from_fn(|l| if bits >> (first + l) & 1 == 1 { yes.0[l] } else { no.0[l] }))
    }
    #[inline(always)]
    fn load_pairs(pairs: &[[f32; 2]; WIDTH], first: usize) -> [Self; 2] {
        [0, 1].map(|i| Self(core::array::from_fn(|l| pairs[first + l][i])))
    }
    #[inline(always)]
    unsafe fn gather_numbers<P: Place>(from: *const f32, places: &[P; WIDTH], first: usize) -> Self {
        // SAFETY: `Numbers` has checked all places against the count of its numbers.
        Self(core::array::from_fn(|l| unsafe { *from.add(places[first + l].at()) }))
    }
    #[inline(always)]
    unsafe fn gather<P: Place>(from: *const [f32; 4], places: &[P; WIDTH], first: usize) -> [Self; 4] {
        let mut out = [Self([0.0; 8]); 4];
        for l in 0..8 {
            // SAFETY: `Window` has checked all places against the length of its vertices.
            let v = unsafe { *from.add(places[first + l].at()) };
            (0..4).for_each(|a| out[a].0[l] = v[a]);
        }
        out
    }
    #[inline(always)]
    unsafe fn scatter(v: [Self; 4], to: *mut [f32; 4], places: &[u16; WIDTH], first: usize, count: usize) {
        for l in 0..count.min(8) {
            // SAFETY: as in `gather`, and the window holds its vertices alone.
            unsafe { *to.add(places[first + l].into()) = core::array::from_fn(|a| v[a].0[l]) };
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Does a little of everything.
    struct Everything<'a>(Window<'a, 2>, &'a Row, usize, Numbers<'a, 2>);

    impl Kernel for Everything<'_> {
        type Out = [Row; 3];
        #[inline(always)]
        fn run<V: Lanes>(mut self) -> [Row; 3] {
            let mut out = [[0f32; WIDTH]; 3];
            for first in (0..WIDTH).step_by(V::N) {
                let (p, q): ([V; 4], [V; 4]) = (self.0.gather(0, 0, first), self.0.gather(0, 1, first));
                let k = V::load(self.1, first);
                let r = core::array::from_fn(|a| ((p[a] - q[a]) * k / p[3]).or_zero().sqrt().or_zero());
                let s = core::array::from_fn(|a| (q[a] + k).if_negative(q[a].max(p[a]), q[a].min(V::splat(2.5))));
                let mut rows = [[0.0; WIDTH]; 2];
                s[1].store(&mut rows[0], first);
                s[2].store(&mut rows[1], first);
                let swapped = core::array::from_fn(|l| [rows[0][l], rows[1][l]]);
                let [q, p]: [V; 2] = V::load_pairs(&swapped, first);
                (p * V::splat(0.7) - q).store(&mut out[0], first);
                p.mul_add(q, k).mul_off(p, k).store(&mut out[1], first);
                let count = self.2.saturating_sub(first);
                let chosen = V::choose(0b1011_0001_1110_0100, first, p, q);
                (r[0] + chosen * self.3.gather(0, 1, first)).store(&mut out[2], first);
                self.0.scatter(0, 0, first, r, count);
                self.0.scatter(0, 1, first, s, count);
            }
            out
        }
    }

    #[test]
    fn every_width_gives_the_bits_of_the_plain_one() {
        let start: Vec<[f32; 4]> =
            (0..40u16).map(|i| core::array::from_fn(|a| ((i * 37 + a as u16 * 11) % 23) as f32 - 11.0)).collect();
        let pairs: Vec<[f32; 2]> = (0..32u8).map(|i| [f32::from(i) * 0.7, f32::from(i) - 40.3]).collect();
        let rows = vec![[core::array::from_fn(|l| 2 * l as u16), core::array::from_fn(|l| 2 * l as u16 + 1)]];
        let places = Places::new(rows);
        let k: Row = core::array::from_fn(|l| l as f32 * 0.3 - 1.0);
        let numbers = || places.numbers(pairs.as_flattened());
        for count in [16, 11, 8, 3, 0] {
            let (mut a, mut b) = (start.clone(), start.clone());
            let wide = widest(Everything(places.over(&mut a), &k, count, numbers()));
            let truth = plain(Everything(places.over(&mut b), &k, count, numbers()));
            let bits = |v: &[[f32; 4]]| v.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            let told = |v: [Row; 3]| bits(v.as_flattened().as_chunks().0);
            assert_eq!(told(wide), told(truth));
            assert_eq!(bits(&a), bits(&b), "{count} lanes");
            #[cfg(target_arch = "x86_64")]
            {
                use super::super::x86;
                let same = |run: &dyn Fn(Everything<'_>) -> [Row; 3]| {
                    let mut c = start.clone();
                    let wide = run(Everything(places.over(&mut c), &k, count, numbers()));
                    assert_eq!(told(wide), told(truth));
                    assert_eq!(bits(&c), bits(&b), "{count} lanes");
                };
                if x86::has_avx2() {
                    same(&|kernel| x86::with_avx2(kernel));
                }
                if x86::has_avx512() {
                    same(&|kernel| x86::sixteen::<_, false>(kernel));
                    same(&|kernel| x86::sixteen::<_, true>(kernel));
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "places over")]
    fn places_beyond_the_vertices_are_refused() {
        let places = Places::new(vec![[[7u16; WIDTH]; 2]]);
        places.over(&mut [[0.0; 4]; 7]);
    }
}
