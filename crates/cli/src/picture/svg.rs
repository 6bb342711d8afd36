//! Small pieces of SVG text.

use super::Colour;
use core::fmt::Write;

/// Text made safe for HTML and SVG, between tags and inside quotes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Control characters are not allowed in either, escaped or not.
            c if c.is_control() && c != '\n' && c != '\t' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// The pattern of a line; patterns tell lines apart where colour does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dash {
    /// Unbroken.
    Solid,
    /// Long dashes.
    Dashed,
    /// Short dashes.
    Dotted,
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Colour.
    pub colour: Colour,
    /// Width in pixels.
    pub width: f64,
    /// Pattern.
    pub dash: Dash,
}

impl Stroke {
    /// A solid line.
    pub const fn solid(colour: Colour, width: f64) -> Self {
        Self { colour, width, dash: Dash::Solid }
    }

    /// A dashed line.
    pub const fn dashed(colour: Colour, width: f64) -> Self {
        Self { colour, width, dash: Dash::Dashed }
    }

    /// Its SVG attributes.
    pub(crate) fn attributes(&self) -> String {
        let pattern = match self.dash {
            Dash::Solid => String::new(),
            Dash::Dashed => " stroke-dasharray=\"6 4\"".to_owned(),
            Dash::Dotted => " stroke-dasharray=\"1.5 3.5\"".to_owned(),
        };
        format!("stroke=\"{}\" stroke-width=\"{:.2}\"{pattern}", self.colour.hex(), self.width)
    }
}

/// The path data of polylines, closed where `closed` says so; a tenth of a pixel is kept.
pub(crate) fn path_data<'a>(lines: impl IntoIterator<Item = (&'a [[f64; 2]], bool)>) -> String {
    let mut out = String::new();
    for (line, closed) in lines {
        for (i, [x, y]) in line.iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = write!(out, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
        }
        if closed && !line.is_empty() {
            out.push('Z');
        }
    }
    out
}

/// An unfilled path.
pub(crate) fn stroked(data: &str, stroke: &Stroke) -> String {
    if data.is_empty() {
        return String::new();
    }
    format!(
        "<path d=\"{data}\" fill=\"none\" {} stroke-linejoin=\"round\" stroke-linecap=\"round\"/>",
        stroke.attributes()
    )
}

/// Text at a point; `anchor` is `start`, `middle` or `end`.
pub(crate) fn text([x, y]: [f64; 2], size: f64, anchor: &str, colour: &str, content: &str) -> String {
    format!(
        "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{colour}\">{}</text>",
        escape(content)
    )
}

/// Text with a dark rim, readable over a scan.
pub(crate) fn rimmed_text([x, y]: [f64; 2], size: f64, anchor: &str, content: &str) -> String {
    format!(
        "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" font-weight=\"bold\" text-anchor=\"{anchor}\" \
         fill=\"#fff\" stroke=\"#000\" stroke-width=\"3\" paint-order=\"stroke\">{}</text>",
        escape(content)
    )
}

/// Estimated width of a text in pixels, for laying out legends without a font at hand.
pub(crate) fn text_width(content: &str, size: f64) -> f64 {
    content.chars().count() as f64 * size * 0.56
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_text_is_disarmed() {
        assert_eq!(escape("<b a='1'>&\"\u{7}"), "&lt;b a=&#39;1&#39;&gt;&amp;&quot;\u{fffd}");
    }

    #[test]
    fn path_data_moves_draws_and_closes() {
        let line = [[0.0, 0.0], [1.25, 2.0]];
        assert_eq!(path_data([(&line[..], true)]), "M0.0 0.0L1.2 2.0Z");
        assert_eq!(stroked("", &Stroke::solid(Colour::BLUE, 1.0)), "");
    }
}
