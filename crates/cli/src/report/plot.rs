//! Line plots and histograms as SVG: axes with units, ticks, legend, events.

use super::scale::Scale;
use crate::picture::{Colour, Dash, Figure, Legend, SERIES, Stroke, number, path_data, stroked, text, text_width};

/// One line of a plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in order; points that are not finite interrupt the line.
    pub points: Vec<[f64; 2]>,
}

/// A plot of lines over a common axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LinePlot {
    /// Caption of the figure.
    pub caption: String,
    /// Name and unit of the horizontal axis.
    pub x_label: String,
    /// Name and unit of the vertical axis.
    pub y_label: String,
    /// Whether the horizontal axis is logarithmic.
    pub log_x: bool,
    /// Whether the vertical axis is logarithmic.
    pub log_y: bool,
    /// The lines.
    pub series: Vec<Series>,
    /// Moments to mark with a vertical line and a name.
    pub events: Vec<(f64, String)>,
}

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 250.0;
/// Space for labels: left, right, top, bottom.
const MARGIN: [f64; 4] = [76.0, 22.0, 20.0, 44.0];

/// Size of the names of events, pixels.
const EVENT_PIXELS: f64 = 11.5;
/// Height of a row of them, pixels.
const ROW: f64 = 13.0;

const X_PIXELS: [f64; 2] = [MARGIN[0], WIDTH - MARGIN[1]];
const Y_PIXELS: [f64; 2] = [HEIGHT - MARGIN[3], MARGIN[2]];

impl LinePlot {
    /// Draws the plot.
    pub fn figure(&self) -> Figure {
        let all = || self.series.iter().flat_map(|s| &s.points);
        let wide = || all().map(|p| p[0]).chain(self.events.iter().map(|e| e.0));
        let (x_low, x_high) = ends(wide());
        let x =
            if self.log_x { Scale::covering(wide(), true, X_PIXELS) } else { Scale::exact(x_low, x_high, X_PIXELS) };
        let y = Scale::covering(all().map(|p| p[1]), self.log_y, Y_PIXELS);
        let mut content = axes(&x, &y, [&self.x_label, &self.y_label]);
        content += &events(&x, &self.events);
        for (i, s) in self.series.iter().enumerate() {
            let data: String = pieces(&s.points, &x, &y).iter().map(|p| path_data([(&p[..], false)])).collect();
            content += &stroked(&data, &stroke_of(i));
        }
        let names = self.series.iter().enumerate().map(|(i, s)| (s.name.as_str(), stroke_of(i)));
        let legend = Legend::of(names, WIDTH - MARGIN[0]);
        content += &format!("<g transform=\"translate({} {HEIGHT})\">{}</g>", MARGIN[0], legend.drawing);
        Figure { width: WIDTH, height: HEIGHT + legend.height, content, caption: self.caption.clone() }
    }
}

/// Colour and pattern of the n-th line.
const fn stroke_of(i: usize) -> Stroke {
    const DASHES: [Dash; 3] = [Dash::Solid, Dash::Dashed, Dash::Dotted];
    Stroke { colour: SERIES[i % SERIES.len()], width: 1.8, dash: DASHES[(i + i / SERIES.len()) % DASHES.len()] }
}

/// Smallest and largest finite value, never equal.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low < high {
        (low, high)
    } else if low == high {
        (low - 0.5, high + 0.5)
    } else {
        (0.0, 1.0)
    }
}

/// The line in pixels, broken where a point has no place; long lines keep the extremes of each pixel column.
fn pieces(points: &[[f64; 2]], x: &Scale, y: &Scale) -> Vec<Vec<[f64; 2]>> {
    let mut out: Vec<Vec<[f64; 2]>> = vec![Vec::new()];
    for p in points {
        match (x.at(p[0]), y.at(p[1])) {
            (Some(px), Some(py)) => {
                if let Some(piece) = out.last_mut() {
                    piece.push([px, py]);
                }
            }
            _ => out.push(Vec::new()),
        }
    }
    out.retain(|p| !p.is_empty());
    out.into_iter().map(|p| if p.len() > 1500 { extremes(&p) } else { p }).collect()
}

/// First, lowest, highest and last point of each pixel column.
fn extremes(piece: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut out = Vec::new();
    for column in piece.chunk_by(|a, b| a[0].floor() == b[0].floor()) {
        let pick = |better: fn(f64, f64) -> bool| {
            (0..column.len()).fold(0, |best, i| if better(column[i][1], column[best][1]) { i } else { best })
        };
        let mut keep = [0, pick(|a, b| a < b), pick(|a, b| a > b), column.len() - 1];
        keep.sort_unstable();
        out.extend(keep.iter().enumerate().filter(|(n, i)| *n == 0 || keep[n - 1] != **i).map(|(_, &i)| column[i]));
    }
    out
}

/// Vertical lines with names beside them, in rows so that none lies on another; a name without room is left out.
fn events(x: &Scale, events: &[(f64, String)]) -> String {
    let rows = ((Y_PIXELS[0] - Y_PIXELS[1]) / ROW) as usize;
    let mut taken: Vec<Vec<[f64; 2]>> = vec![Vec::new(); rows];
    let mut out = String::new();
    for (at, name) in events {
        let Some(px) = x.at(*at) else { continue };
        let line = [[px, Y_PIXELS[0]], [px, Y_PIXELS[1] - 4.0]];
        out += &stroked(&path_data([(&line[..], false)]), &Stroke::dashed(Colour([90, 90, 90]), 1.2));
        let (anchor, start, [left, right]) = beside(px, name);
        let is_free = |row: &[[f64; 2]]| row.iter().all(|other| right < other[0] || other[1] < left);
        let Some(row) = taken.iter().position(|row| is_free(row)) else { continue };
        taken[row].push([left, right]);
        out += &text([start, MARGIN[2] + 8.0 + ROW * row as f64], EVENT_PIXELS, anchor, "#444", name);
    }
    out
}

/// How a name stands beside a line at `px`: its anchor, where that is, and from where to where it reaches.
fn beside(px: f64, name: &str) -> (&'static str, f64, [f64; 2]) {
    let (wide, right, left) = (text_width(name, EVENT_PIXELS), px + 4.0, px - 4.0);
    if right + wide > WIDTH { ("end", left, [left - wide, left]) } else { ("start", right, [right, right + wide]) }
}

/// Frame, grid, ticks and axis names.
fn axes(x: &Scale, y: &Scale, [x_label, y_label]: [&str; 2]) -> String {
    let mut out = String::new();
    let grey = Stroke::solid(Colour([225, 225, 225]), 1.0);
    for (value, label) in x.ticks() {
        let Some(px) = x.at(value) else { continue };
        out += &stroked(&path_data([(&[[px, Y_PIXELS[0]], [px, Y_PIXELS[1]]][..], false)]), &grey);
        out += &text([px, Y_PIXELS[0] + 16.0], 12.0, "middle", "#333", &label);
    }
    for (value, label) in y.ticks() {
        let Some(py) = y.at(value) else { continue };
        out += &stroked(&path_data([(&[[X_PIXELS[0], py], [X_PIXELS[1], py]][..], false)]), &grey);
        out += &text([X_PIXELS[0] - 6.0, py + 4.0], 12.0, "end", "#333", &label);
    }
    let corner = [[X_PIXELS[0], Y_PIXELS[1]], [X_PIXELS[0], Y_PIXELS[0]], [X_PIXELS[1], Y_PIXELS[0]]];
    out += &stroked(&path_data([(&corner[..], false)]), &Stroke::solid(Colour([60, 60, 60]), 1.2));
    out += &text([(X_PIXELS[0] + X_PIXELS[1]) / 2.0, HEIGHT - 8.0], 13.0, "middle", "#222", x_label);
    let middle = (Y_PIXELS[0] + Y_PIXELS[1]) / 2.0;
    out += &format!(
        "<g transform=\"translate(14 {middle:.0}) rotate(-90)\">{}</g>",
        text([0.0, 0.0], 13.0, "middle", "#222", y_label)
    );
    out
}

/// A histogram with its median and 99th percentile marked.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Histogram {
    /// Caption of the figure.
    pub caption: String,
    /// Name of the value.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// The values; those not finite are left out.
    pub values: Vec<f64>,
    /// Whether the counts are on a logarithmic axis.
    pub log_counts: bool,
}

impl Histogram {
    /// Draws the histogram.
    pub fn figure(&self) -> Figure {
        let mut sorted: Vec<f64> = self.values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = ends(sorted.iter().copied());
        let x = Scale::exact(low, high, X_PIXELS);
        let counts = bins(&sorted, low, high);
        // With room above the highest bar for what is marked.
        let (floor, room) = if self.log_counts { (0.8, 3.0) } else { (0.0, 1.25) };
        let most = counts.iter().copied().max().unwrap_or(0) as f64;
        let tops = [floor, room * most].into_iter();
        let y = Scale::covering(tops, self.log_counts, Y_PIXELS);
        let mut content = axes(&x, &y, [&format!("{}, {}", self.label, self.unit), "count"]);
        let wide = (X_PIXELS[1] - X_PIXELS[0]) / counts.len() as f64;
        for (i, &count) in counts.iter().enumerate() {
            let Some(top) = y.at(count as f64).filter(|_| count > 0) else { continue };
            content += &format!(
                "<rect x=\"{:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{}\"/>",
                X_PIXELS[0] + i as f64 * wide + 0.5,
                (wide - 1.0).max(0.5),
                (Y_PIXELS[0] - top).max(0.0),
                Colour::BLUE.hex()
            );
        }
        let mark = |(share, name)| quantile(&sorted, share).map(|v| (v, format!("{name} {} {}", number(v), self.unit)));
        content += &events(&x, &[(0.5, "median"), (0.99, "99 %")].into_iter().filter_map(mark).collect::<Vec<_>>());
        Figure { width: WIDTH, height: HEIGHT, content, caption: self.caption.clone() }
    }
}

fn bins(sorted: &[f64], low: f64, high: f64) -> Vec<usize> {
    let count = ((sorted.len() as f64).sqrt().ceil() as usize).clamp(8, 60);
    let mut out = vec![0; count];
    for v in sorted {
        let bin = ((v - low) / (high - low) * count as f64) as usize;
        out[bin.min(count - 1)] += 1;
    }
    out
}

/// The value below which the given share of the sorted values lies (nearest rank).
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_data_is_drawn_where_it_belongs() {
        let plot = LinePlot {
            y_label: "depth, mm".into(),
            series: vec![Series { name: "depth".into(), points: vec![[0.0, 0.0], [5.0, 50.0], [10.0, 100.0]] }],
            events: vec![(5.0, "CSF".into())],
            ..LinePlot::default()
        };
        let figure = plot.figure();
        // Area: x from 76 to 438, y from 206 (0) up to 20 (100).
        assert!(figure.content.contains("d=\"M76.0 206.0L257.0 113.0L438.0 20.0\""), "{}", figure.content);
        assert!(figure.content.contains(">CSF<") && figure.content.contains(">depth, mm<"));
    }

    /// "right lateral ventricl" stood at the right edge.
    #[test]
    fn long_names_of_events_are_not_cut_off_at_the_right() {
        let x = Scale::exact(0.0, 10.0, X_PIXELS);
        let anchor = |at: f64| beside(x.at(at).expect("within"), "right lateral ventricle").0;
        assert_eq!([1.0, 6.7, 9.0].map(anchor), ["start", "end", "end"]);
    }

    /// The first and the fourth of a run's events stood in one row, on each other.
    #[test]
    fn names_of_events_close_together_stand_below_each_other() {
        let x = Scale::exact(0.0, 10.0, X_PIXELS);
        let named: Vec<_> = (0..40).map(|i| (5.0 + 0.01 * f64::from(i), "brain".to_owned())).collect();
        let drawn = events(&x, &named);
        let mut heights: Vec<&str> = drawn.split(" y=\"").skip(1).map(|t| &t[..t.find('"').expect("an end")]).collect();
        let names = heights.len();
        heights.sort_unstable();
        heights.dedup();
        assert!(heights.len() == names && names > 10, "{names} names at {heights:?}");
        // Far apart, they share the first row.
        let apart = events(&x, &[(1.0, "brain".to_owned()), (5.0, "third ventricle".to_owned())]);
        assert_eq!(apart.matches("y=\"28.0\"").count(), 2, "{apart}");
    }

    #[test]
    fn gaps_break_the_line_and_long_lines_keep_their_spikes() {
        let x = Scale::exact(0.0, 10.0, [0.0, 100.0]);
        let y = Scale::exact(0.0, 1.0, [100.0, 0.0]);
        let broken = [[0.0, 0.5], [1.0, f64::NAN], [2.0, 0.5], [3.0, 0.5]];
        assert_eq!(pieces(&broken, &x, &y).len(), 2);
        let mut many: Vec<[f64; 2]> = (0..50_000).map(|i| [f64::from(i) * 2e-4, 0.2]).collect();
        many[31_234][1] = 1.0;
        let kept = &pieces(&many, &x, &y)[0];
        assert!(kept.len() < 500 && kept.iter().any(|p| p[1] == 0.0), "{}", kept.len());
    }

    #[test]
    fn a_histogram_counts_everything_once_and_marks_its_quantiles() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!((quantile(&values, 0.5), quantile(&values, 0.99)), (Some(50.0), Some(99.0)));
        assert_eq!(bins(&values, 1.0, 100.0).iter().sum::<usize>(), 100);
        let h = Histogram { label: "step".into(), unit: "ms".into(), values, ..Histogram::default() };
        assert!(h.figure().content.contains("median 50 ms") && h.figure().content.contains("99 % 99 ms"));
    }

    #[test]
    fn empty_data_still_makes_a_figure() {
        assert!(LinePlot::default().figure().content.contains("<path"));
        for log_counts in [false, true] {
            assert!(!Histogram { log_counts, ..Histogram::default() }.figure().content.contains("NaN"));
        }
        assert_eq!(quantile(&[], 0.5), None);
    }
}
