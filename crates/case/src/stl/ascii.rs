//! Text: facets of three vertices each, between `solid` and `endsolid`.

use super::StlError;

/// What has been read so far.
#[derive(Default)]
struct Text {
    corners: Vec<[f32; 3]>,
    /// Vertices of the facet that is open.
    facet: Option<usize>,
    /// A solid is open.
    solid: bool,
}

/// The corners of all triangles, three by three. Keywords may be in any case; other words are passed over.
pub(super) fn corners(bytes: &[u8]) -> Result<Vec<[f32; 3]>, StlError> {
    let mut text = Text::default();
    for line in String::from_utf8_lossy(bytes).lines() {
        text.line(line).map_err(|reason| StlError::Triangle { triangle: text.triangles(), reason })?;
    }
    if let Some(n) = text.facet {
        let reason = format!("the file ends inside of this facet, after {n} vertices: it is cut off; export it anew");
        return Err(StlError::Triangle { triangle: text.triangles(), reason });
    }
    if text.solid {
        return Err(StlError::Cut { triangles: text.triangles() });
    }
    Ok(text.corners)
}

impl Text {
    /// Facets that are closed.
    fn triangles(&self) -> usize {
        (self.corners.len() - self.facet.unwrap_or(0)) / 3
    }

    fn line(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next() else { return Ok(()) };
        match word.to_ascii_lowercase().as_str() {
            "solid" => self.solid = true,
            "facet" => match self.facet.replace(0) {
                None => {}
                Some(n) => {
                    self.facet = Some(n);
                    return Err(format!("the facet is not closed after {n} vertices (\"endfacet\")"));
                }
            },
            "vertex" => {
                let n = self.facet.as_mut().ok_or_else(|| format!("\"{}\" is outside of a facet", line.trim()))?;
                let numbers: Option<Vec<f32>> = words.map(|w| w.parse().ok()).collect();
                let corner = numbers.and_then(|n| n.try_into().ok());
                self.corners.push(corner.ok_or_else(|| format!("\"{}\" is no vertex", line.trim()))?);
                *n += 1;
            }
            "endfacet" if self.facet != Some(3) => {
                return Err(format!("the facet has {} vertices, not 3", self.facet.unwrap_or(0)));
            }
            "endfacet" => self.facet = None,
            "endsolid" => self.solid = false,
            _ => {}
        }
        Ok(())
    }
}
