//! One contour being drawn: anchors, the live wire to the mouse, cooling, undo, closing.

use super::features::Features;
use super::links::Links;
use super::training::Training;
use super::wavefront::Wavefront;
use super::{Contour, FeatureOptions, LivewireError, RefineOptions, SliceImage, Weights, check_option, refine};

/// When a wire that no longer changes is fixed by an anchor of its own ("boundary cooling" of MB95).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cooling {
    /// A pixel must have been on the wire for this long, s ...
    pub seconds: f64,
    /// ... and for this many movements of the mouse.
    pub redraws: u32,
    /// Only a piece of at least this many pixels is fixed.
    pub least: usize,
}

impl Default for Cooling {
    fn default() -> Self {
        Self { seconds: 1.0, redraws: 20, least: 30 }
    }
}

/// How a livewire behaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LivewireOptions {
    /// Features of the slice.
    pub features: FeatureOptions,
    /// Weights of the features.
    pub weights: Weights,
    /// Clicks and the free end move to the strongest edge within this many pixels, counted by the shorter side of a pixel
    /// in every direction; 0 takes them as they are.
    pub snap_radius: f64,
    /// Learn from this many pixels of the wire drawn last; 0 for no training.
    pub training_pixels: usize,
    /// Fix stable pieces by themselves; `None` leaves all anchors to the user.
    pub cooling: Option<Cooling>,
    /// Sub-pixel refinement of the closed contour; `None` gives the pixel chain itself.
    pub refine: Option<RefineOptions>,
}

impl Default for LivewireOptions {
    fn default() -> Self {
        Self {
            features: FeatureOptions::default(),
            weights: Weights::default(),
            snap_radius: 4.0,
            training_pixels: 128,
            cooling: None,
            refine: Some(RefineOptions::default()),
        }
    }
}

/// Who set an anchor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The user.
    Click,
    /// Path cooling.
    Cooled,
}

/// A fixed point of the contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Anchor {
    /// Column and row.
    pub pixel: [usize; 2],
    /// Who set it.
    pub origin: Origin,
}

/// Everything that undo restores.
#[derive(Debug, Clone, PartialEq, Default)]
struct Drawing {
    anchors: Vec<Anchor>,
    /// Wire from anchor `n` to the next, both ends included; one more than gaps between anchors once closed.
    segments: Vec<Vec<u32>>,
    closed: bool,
}

/// A pixel of the wire under the mouse.
#[derive(Debug, Clone, Copy)]
struct Warm {
    pixel: u32,
    since: f64,
    redraws: u32,
}

/// A livewire session on one slice.
#[derive(Debug, Clone)]
pub struct Livewire {
    image: SliceImage,
    options: LivewireOptions,
    features: Features,
    training: Training,
    links: Links,
    wave: Option<Wavefront>,
    drawing: Drawing,
    past: Vec<Drawing>,
    future: Vec<Drawing>,
    warm: Vec<Warm>,
}

impl Livewire {
    /// Computes the cost map of a slice.
    ///
    /// # Errors
    /// An option is out of its range.
    pub fn new(image: SliceImage, options: LivewireOptions) -> Result<Self, LivewireError> {
        options.weights.check()?;
        let radius = options.snap_radius;
        check_option("snap_radius", radius, (0.0..=100.0).contains(&radius), "between 0 and 100 pixels")?;
        let features = Features::new(&image, &options.features)?;
        let training = Training::untrained();
        let links = Links::new(&features, &training, &options.weights);
        let (drawing, past, future, warm) = Default::default();
        Ok(Self { image, options, features, training, links, wave: None, drawing, past, future, warm })
    }

    /// The anchors, in drawing order.
    pub fn anchors(&self) -> &[Anchor] {
        &self.drawing.anchors
    }

    /// Whether the contour is closed.
    pub const fn is_closed(&self) -> bool {
        self.drawing.closed
    }

    /// Where a click at a position would be set: the strongest edge within the snap radius, nearer ones preferred
    /// (the "cursor snap" of MB95).
    ///
    /// # Errors
    /// The position is outside the image.
    pub fn snap(&self, position: [f64; 2]) -> Result<[usize; 2], LivewireError> {
        let (w, h) = (self.image.width(), self.image.height());
        let [x, y] = position;
        let within = |v: f64, n: usize| v >= -0.5 && v < n as f64 - 0.5;
        if !within(x, w) || !within(y, h) {
            return Err(LivewireError::Outside { x, y, width: w, height: h });
        }
        let reach = self.options.snap_radius;
        let (mut best, mut most) = (nearest(position), 0.0);
        let [across, down] = self.stretch().map(|side| reach / side);
        let first = |v: f64, reach: f64| (v - reach).ceil().max(0.0) as usize;
        let last = |v: f64, reach: f64, n: usize| ((v + reach).floor().max(0.0) as usize).min(n - 1);
        for row in first(y, down)..=last(y, down, h) {
            for column in first(x, across)..=last(x, across, w) {
                let off = self.apart([column, row], position);
                let strength = f64::from(self.features.pixels[row * w + column].gradient);
                let pull = strength * (1.0 - 0.7 * off / reach.max(1e-9));
                if off <= reach && pull > most {
                    (best, most) = ([column, row], pull);
                }
            }
        }
        Ok(best)
    }

    /// The wire from the last anchor to the snapped mouse, as (column, row), both ends included. Expands the shortest
    /// paths only as far as needed and keeps them for the next call. `seconds` is any steady clock; it serves cooling.
    ///
    /// # Errors
    /// The position is outside the image; there is no anchor; the contour is closed.
    pub fn hover(&mut self, position: [f64; 2], seconds: f64) -> Result<Vec<[usize; 2]>, LivewireError> {
        let target = self.index(self.snap(position)?);
        let path = self.wire_to(target)?;
        self.warm_up(&path, seconds);
        if let Some(cold) = self.cooled_length(seconds) {
            self.remember();
            let piece = path[..=cold].to_vec();
            self.append(piece, Origin::Cooled);
            return Ok(self.wire_to(target)?.into_iter().map(|p| self.pixel(p)).collect());
        }
        Ok(path.into_iter().map(|p| self.pixel(p)).collect())
    }

    /// Spends idle time on shortest paths: settles up to `pixels` more. Returns how many were settled (0 when the whole
    /// slice is reached already, or nothing is started).
    pub fn advance(&mut self, pixels: usize) -> usize {
        self.wave.as_mut().map_or(0, |w| w.expand(&self.links, pixels, usize::MAX))
    }

    /// Sets an anchor at the snapped position, with the wire that `hover` shows. A second click on the last anchor
    /// changes nothing.
    ///
    /// # Errors
    /// The position is outside the image; the contour is closed.
    pub fn click(&mut self, position: [f64; 2]) -> Result<Anchor, LivewireError> {
        if self.drawing.closed {
            return Err(LivewireError::Closed);
        }
        let pixel = self.snap(position)?;
        let target = self.index(pixel);
        match self.drawing.anchors.last() {
            None => {
                self.remember();
                self.append(vec![target as u32], Origin::Click);
            }
            Some(last) if last.pixel == pixel => return Ok(*last),
            Some(_) => {
                let path = self.wire_to(target)?;
                self.remember();
                self.append(path, Origin::Click);
            }
        }
        Ok(Anchor { pixel, origin: Origin::Click })
    }

    /// Whether a click here would land on the first anchor of a contour that can be closed.
    pub fn would_close(&self, position: [f64; 2]) -> bool {
        let radius = self.options.snap_radius.max(1.0);
        let lands_on = |a: &Anchor| self.apart(a.pixel, position) <= radius || nearest(position) == a.pixel;
        self.drawing.anchors.len() > 1 && !self.drawing.closed && self.drawing.anchors.first().is_some_and(lands_on)
    }

    /// Joins the last anchor to the first. Where the shortest way back is mostly the way that was drawn already (as
    /// with two clicks), the wire takes the best other way.
    ///
    /// # Errors
    /// No anchor; closed already; all anchors in one pixel.
    pub fn close(&mut self) -> Result<(), LivewireError> {
        if self.drawing.closed {
            return Err(LivewireError::Closed);
        }
        let first = self.drawing.anchors.first().ok_or(LivewireError::NotStarted)?.pixel;
        let drawn: Vec<u32> = self.drawing.segments.concat();
        if drawn.len() < 2 {
            return Err(LivewireError::Degenerate { points: drawn.len(), area_px: 0.0 });
        }
        let path = self.way_back(self.index(first), &drawn)?;
        self.remember();
        self.drawing.segments.push(path);
        self.drawing.closed = true;
        self.settle();
        Ok(())
    }

    /// Moves one anchor and draws the wires on both its sides anew.
    ///
    /// # Errors
    /// No such anchor; the position is outside the image.
    pub fn move_anchor(&mut self, index: usize, position: [f64; 2]) -> Result<Anchor, LivewireError> {
        let count = self.drawing.anchors.len();
        if index >= count {
            return Err(LivewireError::NoAnchor { index, count });
        }
        let anchor = Anchor { pixel: self.snap(position)?, origin: Origin::Click };
        self.remember();
        self.drawing.anchors[index] = anchor;
        let gaps = self.drawing.segments.len();
        let before = if index > 0 { Some(index - 1) } else { self.drawing.closed.then(|| gaps - 1) };
        for gap in [before, Some(index)].into_iter().flatten().filter(|&g| g < gaps) {
            self.redraw(gap);
        }
        self.settle();
        Ok(anchor)
    }

    /// Takes back the last click, cooled anchor, closing or move; false when there is none.
    pub fn undo(&mut self) -> bool {
        let Some(before) = self.past.pop() else { return false };
        self.future.push(core::mem::replace(&mut self.drawing, before));
        self.settle();
        true
    }

    /// Does again what `undo` took back; false when there is nothing.
    pub fn redo(&mut self) -> bool {
        let Some(after) = self.future.pop() else { return false };
        self.past.push(core::mem::replace(&mut self.drawing, after));
        self.settle();
        true
    }

    /// The fixed wire as (column, row), without the wire to the mouse; each pixel once where pieces meet.
    pub fn fixed(&self) -> Vec<[usize; 2]> {
        self.chain().into_iter().map(|p| self.pixel(p)).collect()
    }

    /// The closed contour, refined to the edge if the options say so.
    ///
    /// # Errors
    /// Not closed yet, or it encloses nothing.
    pub fn contour(&self) -> Result<Contour, LivewireError> {
        if !self.drawing.closed {
            return Err(LivewireError::NotStarted);
        }
        let mut ring = self.chain();
        trim_spurs(&mut ring);
        let points = ring.into_iter().map(|p| self.pixel(p).map(|v| v as f64)).collect();
        let rough = Contour { points };
        rough.check()?;
        match &self.options.refine {
            Some(options) => refine(&self.image, &rough, options),
            None => Ok(rough),
        }
    }

    /// The same anchors on another slice of the same size (the next one, usually): each snaps to its edge there and
    /// all wires are drawn anew, with what was learnt here. Better than a copied contour, which fits neither slice.
    ///
    /// # Errors
    /// The slice has another size.
    pub fn carry_to(&self, image: SliceImage) -> Result<Self, LivewireError> {
        let (expected, found) = ([self.image.width(), self.image.height()], [image.width(), image.height()]);
        if expected != found {
            return Err(LivewireError::MaskSize { expected, found });
        }
        let mut next = Self::new(image, self.options)?;
        next.links = Links::new(&next.features, &self.training, &self.options.weights);
        for anchor in &self.drawing.anchors {
            let pixel = next.snap(anchor.pixel.map(|v| v as f64))?;
            next.drawing.anchors.push(Anchor { pixel, ..*anchor });
        }
        next.drawing.closed = self.drawing.closed;
        next.drawing.segments = vec![Vec::new(); self.drawing.segments.len()];
        for gap in 0..next.drawing.segments.len() {
            next.redraw(gap);
        }
        next.settle();
        Ok(next)
    }

    /// Sides of a pixel by the shorter one: what is near on the screen and in the head, not in rows, which may lie 2 mm apart.
    fn stretch(&self) -> [f64; 2] {
        let [across, down] = self.image.spacing();
        [across, down].map(|side| side / across.min(down))
    }

    /// Distance of a pixel from a position, in shorter sides of a pixel.
    fn apart(&self, pixel: [usize; 2], position: [f64; 2]) -> f64 {
        let [across, down] = self.stretch();
        ((pixel[0] as f64 - position[0]) * across).hypot((pixel[1] as f64 - position[1]) * down)
    }

    fn index(&self, pixel: [usize; 2]) -> usize {
        pixel[1] * self.image.width() + pixel[0]
    }

    fn pixel(&self, index: u32) -> [usize; 2] {
        [index as usize % self.image.width(), index as usize / self.image.width()]
    }

    fn wire_to(&mut self, target: usize) -> Result<Vec<u32>, LivewireError> {
        if self.drawing.closed {
            return Err(LivewireError::Closed);
        }
        let wave = self.wave.as_mut().ok_or(LivewireError::NotStarted)?;
        // Without blocked pixels an 8-connected image is one piece: every pixel is reached.
        wave.reach(&self.links, target);
        Ok(wave.path(&self.links, target))
    }

    fn remember(&mut self) {
        self.past.push(self.drawing.clone());
        self.future.clear();
    }

    /// Adds a wire (or the first anchor, a path of one pixel) and starts from its end.
    fn append(&mut self, path: Vec<u32>, origin: Origin) {
        if let Some(&end) = path.last() {
            self.drawing.anchors.push(Anchor { pixel: self.pixel(end), origin });
        }
        if path.len() > 1 {
            self.drawing.segments.push(path);
        }
        self.settle();
    }

    /// Learns from the drawing and starts the wave at its last anchor. A function of the drawing alone, so that undo
    /// gives back the very wire there was.
    fn settle(&mut self) {
        self.warm.clear();
        let chain = self.chain();
        let recent = &chain[chain.len().saturating_sub(self.options.training_pixels)..];
        let seen: Vec<_> = recent.iter().map(|&p| self.features.pixels[p as usize]).collect();
        let training = if seen.len() < 2 { Training::untrained() } else { Training::learnt(&seen) };
        if training != self.training {
            self.training = training;
            self.links = Links::new(&self.features, &self.training, &self.options.weights);
        }
        let Some(seed) = self.drawing.anchors.last().map(|a| self.index(a.pixel)) else {
            self.wave = None;
            return;
        };
        match &mut self.wave {
            Some(wave) => wave.restart(seed),
            None => self.wave = Some(Wavefront::new(self.features.pixels.len(), seed, &[])),
        }
    }

    /// All pieces in order, the pixel where two meet only once.
    fn chain(&self) -> Vec<u32> {
        let mut out: Vec<u32> = Vec::new();
        for &p in self.drawing.segments.iter().flatten() {
            if out.last() != Some(&p) {
                out.push(p);
            }
        }
        if self.drawing.closed && out.len() > 1 && out.first() == out.last() {
            out.pop();
        }
        out
    }

    /// Draws the wire of one gap between anchors anew.
    fn redraw(&mut self, gap: usize) {
        let count = self.drawing.anchors.len();
        let [from, to] = [gap, (gap + 1) % count].map(|n| self.index(self.drawing.anchors[n].pixel));
        let mut wave = Wavefront::new(self.features.pixels.len(), from, &[]);
        wave.reach(&self.links, to);
        self.drawing.segments[gap] = wave.path(&self.links, to);
    }

    fn way_back(&mut self, first: usize, drawn: &[u32]) -> Result<Vec<u32>, LivewireError> {
        let direct = self.wire_to(first)?;
        let mut used = vec![false; self.features.pixels.len()];
        drawn.iter().for_each(|&p| used[p as usize] = true);
        let again = direct.iter().filter(|&&p| used[p as usize]).count();
        if 2 * again <= direct.len() {
            return Ok(direct);
        }
        let seed = direct[0] as usize;
        let mut wave = Wavefront::new(used.len(), seed, &self.surroundings(drawn));
        Ok(if wave.reach(&self.links, first) { wave.path(&self.links, first) } else { direct })
    }

    /// The drawn pixels with their neighbours, except near the two ends of the drawing.
    fn surroundings(&self, drawn: &[u32]) -> Vec<u32> {
        const OPEN: usize = 3;
        let ends = [drawn[0], drawn[drawn.len() - 1]].map(|p| self.pixel(p));
        let near = |q: [usize; 2]| ends.iter().any(|e| e[0].abs_diff(q[0]).max(e[1].abs_diff(q[1])) <= OPEN);
        let mut out = Vec::new();
        for &p in drawn {
            let around = self.links.cost[p as usize].iter().enumerate().filter(|&(_, &c)| c > 0);
            let neighbours = around.map(|(d, _)| self.links.step(p as usize, d) as u32);
            out.extend(neighbours.chain([p]).filter(|&q| !near(self.pixel(q))));
        }
        out
    }

    /// Counts how long each pixel has been on the wire; paths from one seed share a beginning.
    fn warm_up(&mut self, path: &[u32], seconds: f64) {
        let same = self.warm.iter().zip(path).take_while(|(w, p)| w.pixel == **p).count();
        self.warm.truncate(same);
        self.warm.iter_mut().for_each(|w| w.redraws += 1);
        self.warm.extend(path[same..].iter().map(|&pixel| Warm { pixel, since: seconds, redraws: 0 }));
    }

    /// Index of the last pixel of the piece that has been stable long enough, if it is long enough.
    fn cooled_length(&self, seconds: f64) -> Option<usize> {
        let cooling = self.options.cooling?;
        let cold = |w: &&Warm| seconds - w.since >= cooling.seconds && w.redraws >= cooling.redraws;
        let length = self.warm.iter().take_while(cold).count();
        // The free end itself is never fixed: the user is still moving it.
        let length = length.min(self.warm.len().saturating_sub(1));
        (length >= cooling.least.max(2)).then(|| length - 1)
    }
}

/// The pixel that a position lies in.
fn nearest(position: [f64; 2]) -> [usize; 2] {
    position.map(|v| v.round().max(0.0) as usize)
}

/// Removes there-and-back pieces from a ring (a click beside the edge leaves them).
fn trim_spurs(ring: &mut Vec<u32>) {
    loop {
        let before = ring.len();
        let mut out: Vec<u32> = Vec::with_capacity(before);
        for &p in ring.iter() {
            if out.last() == Some(&p) {
                continue;
            }
            if out.len() >= 2 && out[out.len() - 2] == p {
                out.pop();
            } else {
                out.push(p);
            }
        }
        while out.len() >= 3 && (out[0] == out[out.len() - 1] || out[1] == out[out.len() - 1]) {
            // A spur across the seam: its tip is the first pixel.
            if out[0] == out[out.len() - 1] {
                out.pop();
            } else {
                out.remove(0);
            }
        }
        *ring = out;
        if ring.len() == before {
            return;
        }
    }
}
