//! Axes: from values to pixels, and where to put ticks.

use crate::picture::number;

/// How values fall on an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    low: f64,
    high: f64,
    log: bool,
    pixels: [f64; 2],
}

impl Scale {
    /// A scale that covers the finite values (positive ones, if logarithmic) with round ends, over a pixel range.
    pub(crate) fn covering(values: impl Iterator<Item = f64>, log: bool, pixels: [f64; 2]) -> Self {
        let usable = values.filter(|v| v.is_finite() && (!log || *v > 0.0));
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low > high { if log { (0.1, 10.0) } else { (0.0, 1.0) } } else { (low, high) };
        let (low, high) = if log { log_bounds(low, high) } else { linear_bounds(low, high) };
        Self { low, high, log, pixels }
    }

    /// A linear scale between two values, exactly.
    pub(crate) const fn exact(low: f64, high: f64, pixels: [f64; 2]) -> Self {
        Self { low, high, log: false, pixels }
    }

    /// The pixel of a value; `None` where the scale has no place for it.
    pub(crate) fn at(&self, value: f64) -> Option<f64> {
        if !value.is_finite() || (self.log && value <= 0.0) {
            return None;
        }
        let t = if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        Some(self.pixels[0] + t * (self.pixels[1] - self.pixels[0]))
    }

    /// Ticks with their labels.
    pub(crate) fn ticks(&self) -> Vec<(f64, String)> {
        let values = if self.log { self.log_ticks() } else { self.linear_ticks() };
        values.into_iter().map(|v| (v, number(v))).collect()
    }

    fn linear_ticks(&self) -> Vec<f64> {
        let step = nice_step(self.high - self.low);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step + 1e-9).floor() as i64);
        (first..=last.min(first + 20)).map(|i| i as f64 * step).collect()
    }

    fn log_ticks(&self) -> Vec<f64> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let factors: &[f64] = if last - first > 3 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        (first..=last)
            .flat_map(|e| factors.iter().map(move |f| f * 10f64.powi(e)))
            .filter(|v| *v >= self.low * 0.999 && *v <= self.high * 1.001)
            .collect()
    }
}

/// A step of 1, 2 or 5 times a power of ten, four to eight of which fill the range.
fn nice_step(range: f64) -> f64 {
    let rough = range / 6.0;
    let power = 10f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|f| f * power).find(|s| *s >= rough).unwrap_or(power * 10.0)
}

fn linear_bounds(low: f64, high: f64) -> (f64, f64) {
    // A flat line gets room around it.
    let (low, high) = if high - low > low.abs().max(high.abs()) * 1e-9 {
        (low, high)
    } else {
        let room = low.abs().max(1.0) * 0.5;
        (low - room, high + room)
    };
    let step = nice_step(high - low);
    ((low / step + 1e-9).floor() * step, (high / step - 1e-9).ceil() * step)
}

fn log_bounds(low: f64, high: f64) -> (f64, f64) {
    let ends = |v: f64, up: bool| {
        let power = 10f64.powf(v.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|f| f * power);
        if up {
            steps.into_iter().find(|s| *s >= v).unwrap_or(power * 10.0)
        } else {
            steps.into_iter().rev().find(|s| *s <= v).unwrap_or(power)
        }
    };
    let (low, high) = (ends(low, false), ends(high, true));
    if high > low { (low, high) } else { (low / 2.0, high * 2.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_ticks_are_round() {
        let s = Scale::covering([0.3, 9.2].into_iter(), false, [0.0, 100.0]);
        assert_eq!((s.low, s.high), (0.0, 10.0));
        let labels: Vec<String> = s.ticks().into_iter().map(|t| t.1).collect();
        assert_eq!(labels, ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(s.at(2.5), Some(25.0));
        assert_eq!(s.at(f64::NAN), None);
    }

    #[test]
    fn a_log_scale_puts_decades_at_equal_steps() {
        let s = Scale::covering([0.1, 100.0, -5.0, 0.0].into_iter(), true, [0.0, 300.0]);
        assert_eq!((s.low, s.high), (0.1, 100.0));
        for (v, x) in [(0.1, 0.0), (1.0, 100.0), (10.0, 200.0), (100.0, 300.0)] {
            assert!((s.at(v).unwrap() - x).abs() < 1e-9);
        }
        assert_eq!(s.at(0.0), None);
    }

    #[test]
    fn nothing_and_flat_lines_still_have_a_scale() {
        for values in [vec![], vec![f64::NAN], vec![7.0], vec![0.0], vec![1e12, 1e12]] {
            for log in [false, true] {
                let s = Scale::covering(values.iter().copied(), log, [0.0, 1.0]);
                assert!(s.high > s.low && !s.ticks().is_empty(), "{values:?} {log} {s:?}");
            }
        }
    }
}
