//! Where tools meet tissue: what touches, what holds, what yields.
//!
//! A tool acts on the tissue only through [`Coupling`]s, each on one material point (a point of a face or of an element,
//! by barycentric weights): membranes are *pushed*, tissue that has been cut is *held* by the shaft. Both solvers know
//! couplings and nothing else of tools, and the force on a tool is the sum of its couplings.

pub(crate) mod closest;
mod coupling;
mod detect;
mod insertion;
mod room;
mod shaft;
mod wall;

pub(crate) use coupling::{Coupling, Rule, project};
pub(crate) use detect::Found;
pub(crate) use insertion::{prepare, settle};
use room::Spread;
pub(crate) use room::{Room, take_up};
pub(crate) use wall::{Dimple, Yielded};

use crate::sphere_tree::Spheres;
use crate::tool::Rod;
use crate::vec3::{V3, dot, sub};
use crate::{Model, State};

/// What tools meet: the tissue as it is, and the spheres around its elements.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub(crate) model: &'a Model,
    pub(crate) state: &'a State,
    pub(crate) spheres: &'a Spheres,
}

/// A material point held by the shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Anchor {
    pub(crate) nodes: [u32; 4],
    pub(crate) weights: [f32; 4],
    /// Region it lies in.
    pub(crate) region: u8,
    /// Whether it slides (dynamic friction) or sticks (static).
    pub(crate) slipping: bool,
    /// The place on the shaft it is tied to, mm behind the tip.
    pub(crate) arc: f32,
    /// How far along the axis that place is ahead of the material point (mm, positive towards the tail).
    pub(crate) stretch: f32,
    /// Where that place lies beside the axis, mm: points in elements smaller than the tool lie around it.
    pub(crate) aside: V3,
    /// Where the volume of that piece of shaft makes room for itself.
    pub(crate) spread: Spread,
    /// Share of the piece of shaft that holds it.
    pub(crate) share: f32,
    /// Length of shaft that it answers for, mm.
    pub(crate) length: f32,
}

/// Which way along its own axis a tool goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Advance {
    #[default]
    Forwards,
    Backwards,
}

/// Share of the radius that a tip goes the other way before it counts as turned: a tracker's noise does not turn it.
const TURN: f32 = 0.2;

/// The direction of a tool, with hysteresis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Heading {
    pub(crate) advance: Advance,
    /// The tip where it was furthest on its way.
    furthest: Option<V3>,
}

impl Heading {
    /// Whether the tool has not been seen yet.
    pub(crate) fn is_new(&self) -> bool {
        self.furthest.is_none()
    }

    /// Whether the tip is where it was furthest on its way, not on its way back by less than what counts as turned.
    pub(crate) fn goes_on(&self, tip: V3) -> bool {
        self.furthest == Some(tip)
    }

    /// Follows the tip of `rod`, which goes by `way` in this frame.
    pub(crate) fn follow(&mut self, rod: &Rod, way: V3) {
        let Some(furthest) = self.furthest else {
            self.advance = if dot(way, rod.back) > 0.0 { Advance::Backwards } else { Advance::Forwards };
            self.furthest = Some(rod.tip);
            return;
        };
        let back = dot(sub(rod.tip, furthest), rod.back);
        let (on, turned) = match self.advance {
            Advance::Forwards => (-back, Advance::Backwards),
            Advance::Backwards => (back, Advance::Forwards),
        };
        if on < -TURN * rod.radius {
            self.advance = turned;
        }
        if on >= 0.0 || self.advance == turned {
            self.furthest = Some(rod.tip);
        }
    }
}

/// What the tissue remembers of a tool.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct ToolState {
    /// Region the tip is in; `None` outside.
    pub(crate) inside: Option<u8>,
    /// Whether the tip has been found in the mesh since it went in.
    pub(crate) seen: bool,
    /// Whether it has left it on the far side, with shaft still inside.
    pub(crate) beyond: bool,
    pub(crate) heading: Heading,
    /// The wall that has yielded last, while it may have yet to draw back over the tip.
    pub(crate) yielded: Option<Yielded>,
    /// Vertices of the faces that the tip pressed on when that wall yielded, in order: it goes through them.
    pub(crate) hole: Vec<u32>,
    /// Region that the tip has been found in on its way forwards.
    pub(crate) ahead: Option<u8>,
    /// Material points held by the shaft, from the tip backwards.
    pub(crate) anchors: Vec<Anchor>,
    /// The dimple in the membrane that the tip presses on now.
    pub(crate) press: Option<Dimple>,
    /// Whether its way on leads through that, not along it.
    pub(crate) leads_out: bool,
}
