//! What is summed on a walk around vertices: forces of neighbours and elements, and their derivatives.

use super::streams::Stream;
use crate::fast::{Lanes, Places, View, cross};

/// Three components, and the six different entries of a symmetric matrix (xx, yy, zz, xy, xz, yz).
pub(super) type Vector<V> = [V; 3];
pub(super) type Matrix<V> = [V; 6];

/// An element, by six times its volume `v`: derivative of its energy by `v` at `v = 0` (kPa/6), and the second derivative
/// (kPa/mm3/36).
pub(crate) type Element = [f32; 2];

/// An element with damping, and beside it without.
pub(crate) type Both = [f32; 4];

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

/// Forces with and without damping.
impl<V: Lanes> Around<V> for [Force<V>; 2] {
    type Elements<'e> = &'e [Both];
    type Walk<'e> = View<'e, 1, u32>;

    #[inline(always)]
    fn along<'e>(elements: &'e [Both], places: &'e Places<1, u32>, first: usize, count: usize) -> View<'e, 1, u32> {
        places.view(elements).part(first, count)
    }

    #[inline(always)]
    fn neighbour(&mut self, weight: V, d: &Vector<V>) {
        self[0].add_neighbour(weight, d);
        self[1].add_neighbour(weight, d);
    }

    #[inline(always)]
    fn element(&mut self, (walk, row, first): (&View<'_, 1, u32>, usize, usize), n: &Vector<V>, volume: V) {
        let [slope, rise, undamped_slope, undamped_rise]: [V; 4] = walk.gather(row, 0, first);
        self[0].add_element(rise.mul_off(volume, slope), n);
        self[1].add_element(undamped_rise.mul_off(volume, undamped_slope), n);
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
