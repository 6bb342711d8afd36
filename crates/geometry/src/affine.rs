//! Affine maps between two frames (voxel index to patient, above all).

use crate::{Frame, Matrix3, Point, Vector};
use core::marker::PhantomData;

/// The affine map `x -> linear * x + offset` from frame `From` to frame `To`. Read it `to_from_from`.
pub struct Affine<To, From> {
    /// Linear part.
    pub linear: Matrix3,
    /// Image of the origin, in the units of `To`.
    pub offset: [f64; 3],
    frames: PhantomData<(To, From)>,
}

impl<To, From> Clone for Affine<To, From> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<To, From> Copy for Affine<To, From> {}
impl<To, From> PartialEq for Affine<To, From> {
    fn eq(&self, o: &Self) -> bool {
        self.linear == o.linear && self.offset == o.offset
    }
}

impl<To: Frame, From: Frame> core::fmt::Debug for Affine<To, From> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}_from_{}{:?}+{:?}", To::NAME, From::NAME, self.linear.rows, self.offset)
    }
}

impl<To, From> Affine<To, From> {
    /// From its linear part and offset.
    pub const fn new(linear: Matrix3, offset: [f64; 3]) -> Self {
        Self { linear, offset, frames: PhantomData }
    }

    /// Maps a point.
    pub fn point(&self, p: Point<From>) -> Point<To> {
        let v = self.linear.apply(p.to_array());
        Point::new(v[0] + self.offset[0], v[1] + self.offset[1], v[2] + self.offset[2])
    }

    /// Maps a direction (the offset does not act on it).
    pub fn vector(&self, v: Vector<From>) -> Vector<To> {
        Vector::from_array(self.linear.apply(v.to_array()))
    }

    /// The inverse map; `None` when the linear part is singular.
    pub fn inverse(&self) -> Option<Affine<From, To>> {
        let linear = self.linear.inverse()?;
        let offset = linear.apply(self.offset).map(|v| -v);
        Some(Affine::new(linear, offset))
    }

    /// The map that does `first`, then this one.
    pub fn after<Start>(&self, first: &Affine<From, Start>) -> Affine<To, Start> {
        let offset = self.point(Point::from_array(first.offset)).to_array();
        Affine::new(self.linear.times(&first.linear), offset)
    }
}
