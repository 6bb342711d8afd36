//! What the wire sees in each pixel: gradient, its direction, zero crossings of the Laplacian, and values on both sides.

use super::filter::{gaussian, row_triples};
use super::{LivewireError, SliceImage, check_option};

/// How features are taken from a slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeatureOptions {
    /// Values outside `[low, high]` count as the nearer end, so that bone does not drown soft tissue. Use the window
    /// that the user looks at; the default is the usual brain window, 0 to 80 HU.
    pub window: [f32; 2],
    /// Width of the Gaussian before derivatives, in pixels of the finer direction.
    pub sigma: f64,
    /// How far from the edge the values of its two sides are read, in pixels.
    pub side_offset: f64,
}

impl Default for FeatureOptions {
    fn default() -> Self {
        Self { window: [0.0, 80.0], sigma: 1.5, side_offset: 2.5 }
    }
}

impl FeatureOptions {
    fn check(&self) -> Result<(), LivewireError> {
        let [low, high] = self.window;
        let width = f64::from(high) - f64::from(low);
        check_option("width of the window", width, width.is_finite() && width > 0.0, "positive")?;
        let sigma = self.sigma;
        check_option("sigma", sigma, (0.0..=20.0).contains(&sigma), "between 0 and 20 pixels")?;
        let side = self.side_offset;
        check_option("side_offset", side, (0.0..=20.0).contains(&side), "between 0 and 20 pixels")
    }
}

/// The features of one pixel, each quantised to a byte so that training needs only tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Pixel {
    /// Gradient magnitude, 255 at the ceiling.
    pub(super) gradient: u8,
    /// Direction of the edge (gradient turned by a quarter), 256 steps to a turn, in mm space.
    pub(super) tangent: u8,
    /// Whether the Laplacian crosses zero here.
    pub(super) crossing: bool,
    /// Smoothed value in the window, here and on the brighter and the darker side.
    pub(super) value: u8,
    /// See `value`.
    pub(super) bright: u8,
    /// See `value`.
    pub(super) dark: u8,
}

/// Features of a slice.
#[derive(Debug, Clone)]
pub(super) struct Features {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) spacing: [f64; 2],
    pub(super) pixels: Vec<Pixel>,
    /// Smoothed values in the window.
    smooth: Vec<f32>,
}

impl Features {
    pub(super) fn new(image: &SliceImage, options: &FeatureOptions) -> Result<Self, LivewireError> {
        options.check()?;
        let (width, height, spacing) = (image.width(), image.height(), image.spacing());
        let finest = spacing[0].min(spacing[1]);
        let sigma_mm = options.sigma * finest;
        let [low, high] = options.window;
        let windowed: Vec<f32> = image.data().iter().map(|v| v.clamp(low, high)).collect();
        let smooth = gaussian(&windowed, width, spacing.map(|s| sigma_mm / s));
        let mut out = Self { width, height, spacing, pixels: Vec::new(), smooth };
        let fields = out.derivatives(finest);
        let ceiling = out.gradient_ceiling(&fields.magnitude, options);
        out.pixels = out.quantise(&fields, ceiling, options);
        out.mark_crossings(&fields.laplacian);
        out.read_sides(options);
        Ok(out)
    }

    /// Central differences per finest pixel.
    fn derivatives(&self, finest: f64) -> Fields {
        let n = self.smooth.len();
        let scale = self.spacing.map(|s| (finest / s) as f32);
        let (half, square) = (scale.map(|s| 0.5 * s), scale.map(|s| s * s));
        let mut f = Fields { gx: vec![0.0; n], gy: vec![0.0; n], magnitude: vec![0.0; n], laplacian: vec![0.0; n] };
        let mut at = 0;
        for [above, row, below] in row_triples(&self.smooth, self.width) {
            let mut put = |x: usize, left: f32, right: f32| {
                let gx = half[0] * (right - left);
                let gy = half[1] * (below[x] - above[x]);
                f.gx[at + x] = gx;
                f.gy[at + x] = gy;
                f.magnitude[at + x] = (gx * gx + gy * gy).sqrt();
                f.laplacian[at + x] =
                    square[0] * (left + right - 2.0 * row[x]) + square[1] * (above[x] + below[x] - 2.0 * row[x]);
            };
            let last = self.width - 1;
            put(0, row[0], row[last.min(1)]);
            for x in 1..last.max(1) {
                put(x, row[x - 1], row[(x + 1).min(last)]);
            }
            put(last, row[last.saturating_sub(1)], row[last]);
            at += self.width;
        }
        f
    }

    /// The magnitude that counts as a full edge (MB95 uses the maximum): the 95th percentile over pixels inside
    /// the window, so that neither the skull nor one bright pixel sets the scale, and soft tissue's edges count in full.
    fn gradient_ceiling(&self, magnitude: &[f32], options: &FeatureOptions) -> f32 {
        let [low, high] = options.window;
        let margin = 0.02 * (high - low);
        let inside = |v: f32| v > low + margin && v < high - margin;
        let step = 1024.0 / (high - low);
        let mut counts = [0u32; 1025];
        let mut total = 0u32;
        for (&g, &v) in magnitude.iter().zip(&self.smooth) {
            if inside(v) {
                counts[((g * step) as usize).min(1024)] += 1;
                total += 1;
            }
        }
        let mut above = total / 20;
        let mut bin = 1024;
        while bin > 0 && counts[bin] <= above {
            above -= counts[bin];
            bin -= 1;
        }
        (bin + 1) as f32 / step
    }

    fn quantise(&self, fields: &Fields, ceiling: f32, options: &FeatureOptions) -> Vec<Pixel> {
        let [low, high] = options.window;
        let (to_gradient, to_value) = (255.0 / ceiling, 255.0 / (high - low));
        let gradients = fields.gx.iter().zip(&fields.gy).zip(&fields.magnitude);
        gradients
            .zip(&self.smooth)
            .map(|(((&gx, &gy), &g), &v)| Pixel {
                gradient: (g * to_gradient).min(255.0) as u8,
                tangent: turn_of(gx, gy).wrapping_add(64),
                value: ((v - low) * to_value) as u8,
                ..Pixel::default()
            })
            .collect()
    }

    /// As in MB95: of two neighbours with opposite signs, the one closer to zero is the crossing.
    fn mark_crossings(&mut self, laplacian: &[f32]) {
        let width = self.width;
        let mut mark = |a: usize, b: usize| {
            let (la, lb) = (laplacian[a], laplacian[b]);
            if la * lb < 0.0 {
                self.pixels[if la.abs() <= lb.abs() { a } else { b }].crossing = true;
            }
        };
        for n in 0..laplacian.len() {
            if n % width + 1 < width {
                mark(n, n + 1);
            }
            if n + width < laplacian.len() {
                mark(n, n + width);
            }
        }
        for (p, &l) in self.pixels.iter_mut().zip(laplacian) {
            p.crossing |= l == 0.0 && p.gradient > 0;
        }
    }

    /// Values on the two sides of the edge (the inside and outside pixel features of MB98).
    fn read_sides(&mut self, options: &FeatureOptions) {
        let finest = self.spacing[0].min(self.spacing[1]);
        let reach = self.spacing.map(|s| options.side_offset * finest / s);
        let offsets: Vec<[isize; 2]> = (0..256)
            .map(|turn| {
                let (sin, cos) = (f64::from(turn) * core::f64::consts::TAU / 256.0).sin_cos();
                [(reach[0] * cos).round() as isize, (reach[1] * sin).round() as isize]
            })
            .collect();
        let [low, high] = options.window;
        let to_value = 255.0 / (high - low);
        let (w, h) = (self.width as isize, self.height as isize);
        let smooth = &self.smooth;
        let read = |x: isize, y: isize| {
            let n = y.clamp(0, h - 1) * w + x.clamp(0, w - 1);
            ((smooth[n as usize] - low) * to_value) as u8
        };
        for (y, row) in self.pixels.chunks_exact_mut(self.width).enumerate() {
            for (x, p) in row.iter_mut().enumerate() {
                let [dx, dy] = offsets[usize::from(p.tangent.wrapping_sub(64))];
                p.bright = read(x as isize + dx, y as isize + dy);
                p.dark = read(x as isize - dx, y as isize - dy);
            }
        }
    }
}

struct Fields {
    gx: Vec<f32>,
    gy: Vec<f32>,
    magnitude: Vec<f32>,
    laplacian: Vec<f32>,
}

/// Direction of `(x, y)` in 256ths of a turn, by a cubic fit of the arctangent on one octant (error below 0.3 degrees,
/// a fifth of a step); plain arithmetic, so every machine gives the same bits.
pub(super) fn turn_of(x: f32, y: f32) -> u8 {
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = if ax < ay { (ax, ay) } else { (ay, ax) };
    let t = small / large.max(f32::MIN_POSITIVE);
    // arctan(t) / (pi / 4) on [0, 1], times 32 steps per octant (Rajan et al. 2006, eq. 9).
    let octant = 32.0 * t * (1.0 + (1.0 - t) * (0.3116 + 0.0844 * t));
    let quarter = if ax < ay { 64.0 - octant } else { octant };
    let half = if x < 0.0 { 128.0 - quarter } else { quarter };
    let turn = if y < 0.0 { 256.0 - half } else { half };
    ((turn + 0.5) as u32 & 255) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_right_to_one_step_all_around() {
        for n in 0..3600 {
            let angle = f64::from(n) * core::f64::consts::TAU / 3600.0;
            let turn = f64::from(turn_of(angle.cos() as f32, angle.sin() as f32));
            let exact = f64::from(n) * 256.0 / 3600.0;
            let off = (turn - exact + 128.0).rem_euclid(256.0) - 128.0;
            assert!(off.abs() <= 0.8, "{n}: {off}");
        }
        assert_eq!(turn_of(0.0, 0.0), 0);
    }

    #[test]
    fn a_straight_edge_has_its_direction_crossing_and_sides() {
        // Bright on the right of column 10 (the step lies between columns 9 and 10).
        let data: Vec<f32> = (0..20 * 20).map(|n| if n % 20 < 10 { 10.0 } else { 50.0 }).collect();
        let image = SliceImage::new(20, 20, [1.0, 1.0], data).expect("image");
        let f = Features::new(&image, &FeatureOptions::default()).expect("features");
        let p = f.pixels[10 * 20 + 10];
        assert_eq!(p.tangent, 64);
        assert!(p.gradient > 240, "{}", p.gradient);
        assert!(f.pixels[10 * 20 + 9].crossing || p.crossing);
        assert!(p.bright > 150 && p.dark < 45, "{} {}", p.bright, p.dark);
        assert!(!f.pixels[10 * 20 + 3].crossing);
    }
}
