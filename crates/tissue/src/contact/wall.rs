//! The wall before a tip: how deep it is dimpled, and whether it has drawn back over the tip since it yielded.

use crate::vec3::{V3, dot, norm, sub, unit, xyz};

/// How long a wall that has yielded may take to draw back over the tip, s: tissue that is let go is at rest in about that
/// time, and what has not come by then lies slack.
const DRAWS_BACK: f32 = 0.25;

/// The dimple in the membrane that a tip presses on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dimple {
    /// How deep it is, mm.
    pub(super) depth: f32,
    /// The tip when it was as deep.
    tip: V3,
}

impl Dimple {
    /// Begins, or goes on, where the tip is. It deepens by what that goes along `push`.
    pub(super) fn follow(this: Option<Self>, tip: V3, push: V3) -> Self {
        let Some(Self { depth, tip: before }) = this else { return Self { depth: 0.0, tip } };
        Self { depth: depth + unit(push).map_or(0.0, |push| dot(push, sub(tip, before))), tip }
    }
}

/// A wall that has just yielded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Yielded {
    /// Region that the tip left by it; `None` for the outside.
    pub(super) from: Option<u8>,
    /// How long ago, s.
    pub(super) since: f32,
    /// Whether the tip has been found elsewhere since.
    pub(super) arrived: bool,
    /// How far the tip may be from its nearest vertex and still be before it, mm: a wall that hangs on to the shaft goes along.
    pub(super) reach: f32,
}

/// What is to be expected of the wall that has yielded last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wall {
    /// Nothing: there is none, or the tip is past it.
    Past,
    /// It has yet to draw back over the tip, which has gone through no other as long as it is on the near side.
    DrawsBack,
    /// It has not come and will not.
    Slack,
}

/// How far the vertices around a hole are from `x`, mm.
pub(super) fn away<'a>(hole: &'a [u32], positions: &'a [[f32; 4]], x: V3) -> impl Iterator<Item = f32> + 'a {
    hole.iter().map(move |&n| norm(sub(xyz(positions[n as usize]), x)))
}

impl Yielded {
    /// Whether it is near what lies `away` from the vertices around its hole, mm.
    pub(super) fn is_near(&self, mut away: impl Iterator<Item = f32>) -> bool {
        away.any(|away| away <= self.reach)
    }

    /// Follows a tip that is in region `now`, `away` from the vertices around the hole; the wall is forgotten once it is late,
    /// or not near.
    pub(super) fn follow(this: &mut Option<Self>, now: Option<u8>, away: impl Iterator<Item = f32>) -> Wall {
        let Some(wall) = this.take().filter(|y| y.is_near(away)) else { return Wall::Past };
        let arrived = wall.arrived || now != wall.from;
        if wall.since >= DRAWS_BACK {
            return if arrived { Wall::Past } else { Wall::Slack };
        }
        *this = Some(Self { arrived, ..wall });
        if now == wall.from { Wall::DrawsBack } else { Wall::Past }
    }
}
