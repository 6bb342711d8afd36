//! The wire in the user's hand, and what a closed contour does to the labels.

use super::{Desk, DeskError, Target, views};
use crate::livewire::{
    Axis, Contour, ContourStack, Cooling, FeatureOptions, Livewire, LivewireError, LivewireOptions, SliceImage, fill,
};
use monro_geometry::{Structure, Volume};

/// How the wire behaves; see [`LivewireOptions`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WireOptions {
    /// Window that the user looks at, HU.
    pub window: [f32; 2],
    /// Reach of the cursor snap, in sides of a pixel (the shorter ones); 0 for none.
    pub snap_radius: f64,
    /// Whether stable pieces fix themselves.
    pub cooling: bool,
    /// Whether the wire learns from the piece drawn last.
    pub training: bool,
}

impl Default for WireOptions {
    fn default() -> Self {
        let wire = LivewireOptions::default();
        Self { window: wire.features.window, snap_radius: wire.snap_radius, cooling: false, training: true }
    }
}

impl WireOptions {
    fn livewire(&self) -> LivewireOptions {
        let usual = LivewireOptions::default();
        LivewireOptions {
            features: FeatureOptions { window: self.window, ..usual.features },
            snap_radius: self.snap_radius,
            cooling: self.cooling.then(Cooling::default),
            training_pixels: if self.training { usual.training_pixels } else { 0 },
            ..usual
        }
    }
}

/// What a closed contour does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fill {
    /// Its inside gets the label.
    Add,
    /// The label on this slice becomes its inside: what lies outside is taken away.
    Replace,
    /// Its inside loses the label.
    Erase,
}

/// What the mouse shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Hover {
    /// Where a click would go.
    pub snapped: [usize; 2],
    /// The free wire, from the last anchor to there; empty before the first click.
    pub path: Vec<[usize; 2]>,
    /// Whether a click would close the contour.
    pub closes: bool,
    /// Number of anchors; it grows by itself under cooling.
    pub anchors: usize,
}

/// A wire that is begun and not closed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OpenWire {
    /// Direction of its slice.
    pub axis: Axis,
    /// Number of its slice.
    pub index: usize,
    /// Pixels that no longer change.
    pub fixed: Vec<[usize; 2]>,
    /// Pixels of its anchors.
    pub anchors: Vec<[usize; 2]>,
}

/// A contour that was closed and filled.
#[derive(Debug, Clone, PartialEq)]
pub struct Closed {
    /// The contour, sub-pixel.
    pub contour: Contour,
    /// Voxels whose label changed.
    pub changed: usize,
    /// Anchors that it took.
    pub anchors: usize,
}

/// A wire on its slice.
#[derive(Debug)]
pub(super) struct Wire {
    axis: Axis,
    index: usize,
    wire: Livewire,
}

impl Wire {
    pub(super) fn undo(&mut self) -> bool {
        self.wire.undo()
    }

    pub(super) fn redo(&mut self) -> bool {
        self.wire.redo()
    }
}

impl Desk {
    /// Changes how the wire behaves; an open wire keeps its ways until the next contour.
    pub fn set_wire_options(&mut self, options: WireOptions) {
        if options != self.wire_options {
            self.wire_options = options;
            self.scout = None;
            if self.wire.as_ref().is_some_and(|w| w.wire.anchors().is_empty()) {
                self.wire = None;
            }
        }
    }

    /// Where the open wire is, when that is not on this slice.
    fn open_elsewhere(&self, axis: Axis, index: usize) -> Option<(Axis, usize)> {
        let open = self.wire.as_ref().filter(|w| !w.wire.anchors().is_empty());
        open.map(|w| (w.axis, w.index)).filter(|place| *place != (axis, index))
    }

    /// The wire on a slice, begun there unless it is one that asks the scan anew.
    fn wire_in<'a>(
        slot: &'a mut Option<Wire>,
        (ct, options): (&Volume<i16>, &WireOptions),
        (axis, index): (Axis, usize),
    ) -> Result<&'a mut Livewire, DeskError> {
        if slot.as_ref().is_none_or(|w| (w.axis, w.index) != (axis, index)) {
            let image = SliceImage::of(ct, axis, index)?;
            let wire = Livewire::new(image, options.livewire())?;
            *slot = Some(Wire { axis, index, wire });
        }
        slot.as_mut().map(|w| &mut w.wire).ok_or(DeskError::Wire(LivewireError::NotStarted))
    }

    /// The wire under the mouse; on another slice than that of the open wire only where a click would go. `seconds` is
    /// any steady clock.
    ///
    /// # Errors
    /// The slice or the position does not exist.
    pub fn hover(&mut self, axis: Axis, index: usize, at: [f64; 2], seconds: f64) -> Result<Hover, DeskError> {
        let elsewhere = self.open_elsewhere(axis, index).is_some();
        let slot = if elsewhere { &mut self.scout } else { &mut self.wire };
        let wire = Self::wire_in(slot, (&self.ct, &self.wire_options), (axis, index))?;
        let path = if wire.anchors().is_empty() { Vec::new() } else { wire.hover(at, seconds)? };
        Ok(Hover { snapped: wire.snap(at)?, path, closes: wire.would_close(at), anchors: wire.anchors().len() })
    }

    /// Sets an anchor.
    ///
    /// # Errors
    /// The slice or the position does not exist; a wire is open on another slice.
    pub fn click(&mut self, axis: Axis, index: usize, at: [f64; 2]) -> Result<(), DeskError> {
        self.end_stroke();
        if let Some((axis, slice)) = self.open_elsewhere(axis, index) {
            let view = views(self.ct.grid()).into_iter().find(|v| v.axis == axis).map_or("another", |v| v.name);
            return Err(DeskError::WireElsewhere { view, slice });
        }
        Self::wire_in(&mut self.wire, (&self.ct, &self.wire_options), (axis, index))?.click(at)?;
        Ok(())
    }

    /// Moves an anchor of the open wire.
    ///
    /// # Errors
    /// No wire, no such anchor, a position outside the slice.
    pub fn move_anchor(&mut self, anchor: usize, at: [f64; 2]) -> Result<(), DeskError> {
        let wire = self.wire.as_mut().ok_or(LivewireError::NotStarted)?;
        wire.wire.move_anchor(anchor, at)?;
        Ok(())
    }

    /// Gives the open wire up; false when there is none.
    pub fn drop_wire(&mut self) -> bool {
        self.wire.take().is_some_and(|w| !w.wire.anchors().is_empty())
    }

    /// The open wire, if one is begun.
    pub fn open_wire(&self) -> Option<OpenWire> {
        let w = self.wire.as_ref().filter(|w| !w.wire.anchors().is_empty())?;
        let anchors = w.wire.anchors().iter().map(|a| a.pixel).collect();
        Some(OpenWire { axis: w.axis, index: w.index, fixed: w.wire.fixed(), anchors })
    }

    /// Closes the wire and fills it, in one step. With `interpolate`, slices between this one and the next ones that
    /// were drawn in this direction are filled again too.
    ///
    /// # Errors
    /// No open wire, a contour that encloses nothing, a label that names no structure; it stays open then.
    pub fn close(&mut self, target: &Target, mode: Fill, interpolate: bool) -> Result<Closed, DeskError> {
        let Some(Wire { axis, index, wire }) = &self.wire else {
            return Err(LivewireError::NotStarted.into());
        };
        // A copy is closed, so that whatever is refused leaves the wire as it is.
        let (axis, index, mut closed) = (*axis, *index, wire.clone());
        closed.close()?;
        let contour = closed.contour()?;
        let anchors = closed.anchors().len();
        let changed = self.as_one_step(|desk| {
            let mut changed = desk.fill(axis, index, &contour, target, mode)?;
            desk.key(axis, target.label, index);
            if interpolate {
                changed += desk.correct_between(axis, target, index)?;
            }
            Ok(changed)
        })?;
        self.wire = None;
        Ok(Closed { contour, changed, anchors })
    }

    fn fill(
        &mut self,
        axis: Axis,
        index: usize,
        contour: &Contour,
        target: &Target,
        mode: Fill,
    ) -> Result<usize, DeskError> {
        let dims = self.ct.grid().dims();
        let [w, h] = axis.in_plane().map(|a| dims[a]);
        let inside = self.selection(axis, index, &fill(core::slice::from_ref(contour), w, h));
        if mode == Fill::Replace {
            let now = self.selection(axis, index, &self.mask(axis, index, target.label)?);
            return self.reshape(&now, &inside, target);
        }
        Ok(self.change(&inside, target, mode == Fill::Erase)?.count())
    }

    /// Fills a label on all slices between those on which it was drawn in a direction, in one step.
    ///
    /// # Errors
    /// It was drawn on fewer than two slices.
    pub fn interpolate(&mut self, axis: Axis, target: &Target) -> Result<usize, DeskError> {
        self.as_one_step(|desk| desk.fill_between(axis, target, None))
    }

    /// Fills again between a slice that was just drawn and the next drawn ones, if there are any.
    pub(super) fn correct_between(&mut self, axis: Axis, target: &Target, index: usize) -> Result<usize, DeskError> {
        if self.drawn_slices(axis, target.label).len() < 2 {
            return Ok(0);
        }
        self.fill_between(axis, target, Some(index))
    }

    /// As [`Desk::interpolate`]; with `around` only the slices up to the neighbours of that drawn one.
    fn fill_between(&mut self, axis: Axis, target: &Target, around: Option<usize>) -> Result<usize, DeskError> {
        let keys = self.drawn_slices(axis, target.label);
        let name = Structure::from_label(target.label).ok_or(DeskError::Label(target.label))?.name();
        let ([Some(&first), Some(&last)], true) = ([keys.first(), keys.last()], keys.len() > 1) else {
            return Err(DeskError::TooFewSlices { label: name, slices: keys.len() });
        };
        let grid = *self.ct.grid();
        let [c, r] = axis.in_plane();
        let mut stack = ContourStack::new([grid.dims()[c], grid.dims()[r]], [grid.spacing()[c], grid.spacing()[r]])?;
        for &slice in &keys {
            stack.set_mask(slice, self.mask(axis, slice, target.label)?)?;
        }
        let touched = around.map_or(first..=last, |around| {
            let below = keys.iter().rev().find(|&&k| k < around).copied().unwrap_or(around);
            let above = keys.iter().find(|&&k| k > around).copied().unwrap_or(around);
            below..=above
        });
        let mut changed = 0;
        for slice in touched.filter(|s| !keys.contains(s)) {
            let shape = self.selection(axis, slice, &stack.mask(slice));
            let now = self.selection(axis, slice, &self.mask(axis, slice, target.label)?);
            changed += self.reshape(&now, &shape, target)?;
        }
        Ok(changed)
    }
}
