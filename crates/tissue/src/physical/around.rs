//! What is summed on a walk around vertices: forces of neighbours and elements, and their derivatives.

use super::streams::Stream;
use crate::fast::{Lanes, Line, Places, Row, WIDTH, ask_ahead, cross};

/// Three components, and the six different entries of a symmetric matrix (xx, yy, zz, xy, xz, yz).
pub(super) type Vector<V> = [V; 3];
pub(super) type Matrix<V> = [V; 6];

/// What is summed on a walk around the vertices of a batch.
pub(super) trait Around<V: Lanes> {
    /// The elements that it goes by, all of them and those of a walk.
    type Elements<'e>;
    type Walk<'e>;

    /// The elements of `count` rows of `places` from `first` on.
    fn along<'e>(
        elements: Self::Elements<'e>,
        places: &'e Places<1, u32>,
        first: usize,
        count: usize,
    ) -> Self::Walk<'e>;

    /// Asks for the elements that come later than those of row `k` of a walk.
    fn ask_ahead(walk: &Self::Walk<'_>, k: usize);

    /// A neighbour at `d` with its weight in the shear matrix.
    fn neighbour(&mut self, weight: V, d: &Vector<V>);

    /// Elements of row `at.1` of a walk, lanes from `at.2`: six times the gradient of their volumes, and minus six times these.
    fn element(&mut self, at: (&Self::Walk<'_>, usize, usize), n: &Vector<V>, volume: V);
}

/// Force of neighbours, times `damped`, and elements.
pub(super) struct Force<V> {
    pub(super) sum: Vector<V>,
    pub(super) damped: V,
}

/// The force, and its derivative by elements.
pub(super) struct Sums<V> {
    pub(super) force: Force<V>,
    pub(super) hessian: Matrix<V>,
}

impl<V: Lanes> Force<V> {
    #[inline(always)]
    fn add_neighbour(&mut self, weight: V, d: &Vector<V>) {
        let weight = weight * self.damped;
        for (sum, d) in self.sum.iter_mut().zip(d) {
            *sum = weight.mul_add(*d, *sum);
        }
    }

    /// With the derivative of the element's energy by six times its volume.
    #[inline(always)]
    fn add_element(&mut self, slope: V, n: &Vector<V>) {
        for (sum, n) in self.sum.iter_mut().zip(n) {
            *sum = slope.mul_add(*n, *sum);
        }
    }
}

impl<V: Lanes> Around<V> for Sums<V> {
    type Elements<'e> = Stream<'e>;
    type Walk<'e> = Stream<'e>;

    #[inline(always)]
    fn along<'e>(elements: Stream<'e>, _: &'e Places<1, u32>, first: usize, count: usize) -> Stream<'e> {
        Stream { slope: &elements.slope[first..][..count], rise: &elements.rise[first..][..count] }
    }

    #[inline(always)]
    fn ask_ahead(walk: &Self::Walk<'_>, k: usize) {
        ask_ahead(walk.slope, k);
        ask_ahead(walk.rise, k);
    }

    #[inline(always)]
    fn neighbour(&mut self, weight: V, d: &Vector<V>) {
        self.force.add_neighbour(weight, d);
    }

    #[inline(always)]
    fn element(&mut self, (walk, row, first): (&Stream<'_>, usize, usize), n: &Vector<V>, volume: V) {
        let (still, rise) = (V::load(&walk.slope[row], first), V::load(&walk.rise[row], first));
        self.force.add_element(rise.mul_off(volume, still), n);
        let m = [rise * n[0], rise * n[1], rise * n[2]];
        for a in 0..3 {
            self.hessian[a] = m[a].mul_add(n[a], self.hessian[a]);
        }
        self.hessian[3] = m[0].mul_add(n[1], self.hessian[3]);
        self.hessian[4] = m[0].mul_add(n[2], self.hessian[4]);
        self.hessian[5] = m[1].mul_add(n[2], self.hessian[5]);
    }
}

/// What resists motion: forces of neighbours and elements that damping has a share in.
pub(super) struct Resistance<V>(pub(super) Force<V>);

/// What damping has of elements.
#[derive(Clone, Copy)]
pub(super) struct Damped<'a> {
    /// Of each region: its derivative at no volume (kPa/6), and its share of the second derivative.
    pub(super) regions: &'a [[f32; 2]],
    /// Region of each element.
    pub(super) region: &'a [u8],
    /// The second derivatives along the walks of a part, and the regions of these rows.
    pub(super) rise: &'a [Line],
    pub(super) rows: &'a [RowRegions],
}

/// Regions of a row of elements along a walk.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowRegions {
    /// Two of them, the same one where all elements are of one.
    regions: [u8; 2],
    /// Whether there are more.
    several: bool,
    /// Bits of the lanes of the second one, and of those that have an element.
    second: u16,
    has: u16,
}

impl RowRegions {
    /// Of a row of elements, the larger numbers of which are none.
    pub(super) fn of(row: &[u32; WIDTH], region: &[u8]) -> Self {
        let regions = row.map(|t| region.get(t as usize).copied());
        let lanes = |is: &dyn Fn(u8) -> bool| (0..WIDTH).map(|l| u16::from(regions[l].is_some_and(is)) << l).sum();
        let some = || regions.iter().flatten().copied();
        let first = some().next().unwrap_or(0);
        let other = some().find(|&r| r != first).unwrap_or(first);
        Self {
            regions: [first, other],
            several: some().any(|r| r != first && r != other),
            second: lanes(&|r| r != first),
            has: lanes(&|_| true),
        }
    }
}

impl Damped<'_> {
    /// Of a row of elements along a walk: derivatives at no volume and shares of the second ones. Spelled out, not mapped:
    /// closures would be compiled for any processor.
    #[inline(always)]
    fn row<V: Lanes>(&self, of: RowRegions, (places, row): (&Places<1, u32>, usize), first: usize) -> [V; 2] {
        if of.several {
            let [slopes, shares] = self.several(&places.row(row)[0]);
            return [V::load(&slopes, first), V::load(&shares, first)];
        }
        let [slope, share] = self.regions[of.regions[0] as usize];
        let [other_slope, other_share] = self.regions[of.regions[1] as usize];
        let slope = V::choose(of.second, first, V::splat(other_slope), V::splat(slope));
        let share = V::choose(of.second, first, V::splat(other_share), V::splat(share));
        [V::choose(of.has, first, slope, V::splat(0.0)), share]
    }

    /// The same of a row with more than two regions.
    #[inline(never)]
    fn several(&self, row: &[u32; WIDTH]) -> [Row; 2] {
        let of = row.map(|t| self.region.get(t as usize).map_or([0.0; 2], |&r| self.regions[r as usize]));
        [of.map(|r| r[0]), of.map(|r| r[1])]
    }
}

impl<V: Lanes> Around<V> for Resistance<V> {
    type Elements<'e> = Damped<'e>;
    type Walk<'e> = (Damped<'e>, &'e Places<1, u32>, usize);

    #[inline(always)]
    fn along<'e>(elements: Damped<'e>, places: &'e Places<1, u32>, first: usize, count: usize) -> Self::Walk<'e> {
        let (rise, rows) = (&elements.rise[first..][..count], &elements.rows[first..][..count]);
        (Damped { rise, rows, ..elements }, places, first)
    }

    #[inline(always)]
    fn ask_ahead(walk: &Self::Walk<'_>, k: usize) {
        ask_ahead(walk.0.rise, k);
    }

    #[inline(always)]
    fn neighbour(&mut self, weight: V, d: &Vector<V>) {
        self.0.add_neighbour(weight, d);
    }

    #[inline(always)]
    fn element(&mut self, (walk, row, first): (&Self::Walk<'_>, usize, usize), n: &Vector<V>, volume: V) {
        let (elements, places, start) = walk;
        let [slope, share] = elements.row::<V>(elements.rows[row], (places, start + row), first);
        let rise = V::load(&elements.rise[row], first) * share;
        self.0.add_element(rise.mul_off(volume, slope), n);
    }
}

/// A vertex as seen from `p`.
#[inline(always)]
pub(super) fn away<V: Lanes>(q: [V; 4], p: &[V; 4]) -> Vector<V> {
    [q[0] - p[0], q[1] - p[1], q[2] - p[2]]
}

/// Six times the gradient of an element's volume by the vertex that the corners `a`, `b` and `c` are seen from.
#[inline(always)]
pub(super) fn area<V: Lanes>(a: &Vector<V>, b: &Vector<V>, c: &Vector<V>) -> Vector<V> {
    cross([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::{Kernel, plain, widest};

    const REGION: [u8; 5] = [1, 1, 0, 2, 2];
    const REGIONS: [[f32; 2]; 3] = [[-3.0, 0.5], [-5.0, 0.25], [-7.0, 0.125]];

    /// Forces of a row of elements, each with the gradient (1, 2, 3) and the negative volume 2.
    struct Forces([u32; WIDTH]);

    impl Kernel for Forces {
        type Out = [Row; 3];

        #[inline(always)]
        fn run<V: Lanes>(self) -> [Row; 3] {
            let rise = [Line(self.0.map(|t| if (t as usize) < REGION.len() { 8.0 } else { 0.0 }))];
            let rows = [RowRegions::of(&self.0, &REGION)];
            let elements = Damped { regions: &REGIONS, region: &REGION, rise: &rise, rows: &rows };
            let places = Places::new(vec![[self.0]]);
            let walk = <Resistance<V> as Around<V>>::along(elements, &places, 0, 1);
            let mut out = [[0.0; WIDTH]; 3];
            for first in (0..WIDTH).step_by(V::N) {
                let mut sum = Resistance(Force { sum: [V::splat(0.0); 3], damped: V::splat(1.0) });
                sum.element((&walk, 0, first), &[1.0, 2.0, 3.0].map(V::splat), V::splat(2.0));
                (0..3).for_each(|a| sum.0.sum[a].store(&mut out[a], first));
            }
            out
        }
    }

    #[test]
    fn damping_has_the_share_of_each_elements_region_and_none_of_what_is_none() {
        let one = core::array::from_fn(|l| if l % 3 == 0 { 5 } else { (l % 2) as u32 });
        let two = core::array::from_fn(|l| [1, 3, 5][l % 3]);
        let several = core::array::from_fn(|l| (l % 7) as u32);
        for row in [one, two, several] {
            let force = |t: u32| {
                let of = REGION.get(t as usize).map(|&r| REGIONS[r as usize]);
                of.map_or(0.0, |[slope, share]| slope - 16.0 * share)
            };
            for out in [plain(Forces(row)), widest(Forces(row))] {
                for (l, wanted) in row.into_iter().map(force).enumerate() {
                    assert_eq!([0, 1, 2].map(|a| out[a][l]), [wanted, 2.0 * wanted, 3.0 * wanted], "lane {l}");
                }
            }
        }
    }
}
