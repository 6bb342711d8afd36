//! What the page asks for, as JSON, and what the desk does then.

use monro_anatomy::desk::{Desk, DeskError, Fill, SetOperation, Target, Tool, WireOptions};
use monro_anatomy::livewire::Axis;
use serde::Deserialize;
use serde_json::{Value, json};

/// One message of the page; the answer carries the same `id`.
#[derive(Debug, Deserialize)]
pub(super) struct Request {
    pub(super) id: u64,
    #[serde(flatten)]
    action: Action,
}

impl Request {
    /// Whether it is part of a stroke of the brush.
    pub(super) const fn paints(&self) -> bool {
        matches!(self.action, Action::Brush(_))
    }

    /// Whether it ends one.
    pub(super) const fn ends_stroke(&self) -> bool {
        matches!(self.action, Action::EndStroke(_))
    }

    /// A question for how things are, with the same id.
    pub(super) const fn state(id: u64) -> Self {
        Self { id, action: Action::State }
    }
}

/// A message; or the answer to one that is not understood, with its id where it has one: the page waits for it.
pub(super) fn parse(text: &str) -> Result<Request, Value> {
    serde_json::from_str(text).map_err(|e| {
        let message: Option<Value> = serde_json::from_str(text).ok();
        json!({ "id": message.as_ref().and_then(|m| m["id"].as_u64()), "error": format!("not understood: {e}") })
    })
}

#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "snake_case")]
enum Action {
    State,
    Hover {
        axis: usize,
        slice: usize,
        at: [f64; 2],
        time: f64,
    },
    Click {
        axis: usize,
        slice: usize,
        at: [f64; 2],
    },
    MoveAnchor {
        anchor: usize,
        at: [f64; 2],
    },
    Close {
        target: TargetJson,
        mode: FillJson,
        interpolate: bool,
    },
    DropWire,
    WireOptions {
        window: [f32; 2],
        snap_radius: f64,
        cooling: bool,
        training: bool,
    },
    Interpolate {
        axis: usize,
        target: TargetJson,
    },
    Brush(BrushJson),
    EndStroke(EndJson),
    Preview {
        tool: ToolJson,
        target: TargetJson,
    },
    Apply {
        target: TargetJson,
        /// The number of the preview that was seen.
        preview: Option<u64>,
    },
    Discard,
    Undo,
    Redo,
}

#[derive(Debug, Deserialize)]
struct TargetJson {
    label: u8,
    #[serde(default)]
    over: Option<Vec<u8>>,
    #[serde(default)]
    range: Option<[i16; 2]>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum FillJson {
    Add,
    Replace,
    Erase,
}

#[derive(Debug, Deserialize)]
struct BrushJson {
    target: TargetJson,
    axis: usize,
    slice: usize,
    points: Vec<[f64; 2]>,
    radius_mm: f64,
    flat: bool,
    erase: bool,
}

#[derive(Debug, Deserialize)]
struct EndJson {
    #[serde(default)]
    interpolate: bool,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "name", rename_all = "snake_case")]
enum ToolJson {
    Threshold { range: [i16; 2] },
    Grow { seed: [usize; 3], range: [i16; 2], neck_mm: f64, most_ml: f64 },
    LargestIsland,
    SmallIslands { least_ml: f64 },
    Split { into: u8 },
    FillHoles { axis: Option<usize> },
    Smooth { sigma_mm: f64 },
    Margin { mm: f64 },
    Combine { operation: SetJson, with: u8, margin_mm: f64 },
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SetJson {
    Union,
    Intersection,
    Difference,
    SymmetricDifference,
}

/// Index direction 0, 1 or 2.
pub(super) fn axis(number: usize) -> Result<Axis, String> {
    Axis::ALL.get(number).copied().ok_or_else(|| format!("there is no direction {number}; they are 0, 1 and 2"))
}

impl From<TargetJson> for Target {
    fn from(t: TargetJson) -> Self {
        Self { label: t.label, over: t.over, range: t.range.map(|[low, high]| low..=high) }
    }
}

impl ToolJson {
    fn tool(self) -> Result<Tool, String> {
        Ok(match self {
            Self::Threshold { range: [low, high] } => Tool::Threshold { range: low..=high },
            Self::Grow { seed, range: [low, high], neck_mm, most_ml } => {
                Tool::Grow { seed, range: low..=high, neck_mm, most_ml }
            }
            Self::LargestIsland => Tool::LargestIsland,
            Self::SmallIslands { least_ml } => Tool::SmallIslands { least_ml },
            Self::Split { into } => Tool::Split { into },
            Self::FillHoles { axis: number } => Tool::FillHoles { axis: number.map(axis).transpose()? },
            Self::Smooth { sigma_mm } => Tool::Smooth { sigma_mm },
            Self::Margin { mm } => Tool::Margin { mm },
            Self::Combine { operation, with, margin_mm } => {
                let operation = match operation {
                    SetJson::Union => SetOperation::Union,
                    SetJson::Intersection => SetOperation::Intersection,
                    SetJson::Difference => SetOperation::Difference,
                    SetJson::SymmetricDifference => SetOperation::SymmetricDifference,
                };
                Tool::Combine { operation, with, margin_mm }
            }
        })
    }
}

/// Does what a message asks; the answer without its id.
///
/// # Errors
/// A sentence for the user.
pub(super) fn answer(desk: &mut Desk, request: Request) -> Result<Value, String> {
    act(desk, request.action).map_err(|e| e.0)
}

/// A sentence for the user.
struct Said(String);

impl From<DeskError> for Said {
    fn from(e: DeskError) -> Self {
        Self(e.to_string())
    }
}

impl From<String> for Said {
    fn from(e: String) -> Self {
        Self(e)
    }
}

fn act(desk: &mut Desk, action: Action) -> Result<Value, Said> {
    let mut out = match action {
        Action::Hover { axis: a, slice, at, time } => return Ok(hover(desk, (axis(a)?, slice), at, time)?),
        Action::Brush(b) => return brush(desk, b),
        Action::WireOptions { window, snap_radius, cooling, training } => {
            desk.set_wire_options(WireOptions { window, snap_radius, cooling, training });
            return Ok(json!({}));
        }
        Action::State => json!({}),
        Action::Click { axis: a, slice, at } => {
            desk.click(axis(a)?, slice, at)?;
            return Ok(json!({ "wire": wire(desk) }));
        }
        Action::MoveAnchor { anchor, at } => {
            desk.move_anchor(anchor, at)?;
            return Ok(json!({ "wire": wire(desk) }));
        }
        Action::Close { target, mode, interpolate } => close(desk, &target.into(), mode, interpolate)?,
        Action::DropWire => json!({ "done": desk.drop_wire() }),
        Action::Interpolate { axis: a, target } => json!({ "changed": desk.interpolate(axis(a)?, &target.into())? }),
        Action::EndStroke(EndJson { interpolate: true }) => json!({ "changed": desk.end_stroke_between()? }),
        Action::EndStroke(EndJson { interpolate: false }) => {
            desk.end_stroke();
            json!({})
        }
        Action::Preview { tool, target } => {
            let voxel_ml = desk.ct().grid().voxel_volume() / 1000.0;
            let shown = desk.preview(&tool.tool()?, &target.into())?;
            json!({ "preview": { "ml": shown.selection.count() as f64 * voxel_ml, "stopped": shown.stopped, "number": shown.number } })
        }
        Action::Apply { target, preview } => json!({ "changed": desk.apply(&target.into(), preview)? }),
        Action::Discard => json!({ "done": desk.discard() }),
        Action::Undo => json!({ "done": desk.undo() }),
        Action::Redo => json!({ "done": desk.redo() }),
    };
    out["state"] = state(desk);
    out["wire"] = wire(desk);
    Ok(out)
}

fn hover(desk: &mut Desk, (axis, slice): (Axis, usize), at: [f64; 2], time: f64) -> Result<Value, DeskError> {
    let before = desk.open_wire().map_or(0, |w| w.anchors.len());
    let shown = desk.hover(axis, slice, at, time)?;
    let mut out = json!({ "snapped": shown.snapped, "path": shown.path, "closes": shown.closes });
    if shown.anchors != before {
        // Cooling has fixed a piece.
        out["wire"] = wire(desk);
    }
    Ok(out)
}

fn close(desk: &mut Desk, target: &Target, mode: FillJson, interpolate: bool) -> Result<Value, DeskError> {
    let mode = match mode {
        FillJson::Add => Fill::Add,
        FillJson::Replace => Fill::Replace,
        FillJson::Erase => Fill::Erase,
    };
    let closed = desk.close(target, mode, interpolate)?;
    let area = closed.contour.signed_area().abs();
    Ok(
        json!({ "changed": closed.changed, "anchors": closed.anchors, "area_px": area, "contour": closed.contour.points }),
    )
}

fn brush(desk: &mut Desk, b: BrushJson) -> Result<Value, Said> {
    let how = (b.radius_mm, b.flat, b.erase);
    let changed = desk.brush(&b.target.into(), (axis(b.axis)?, b.slice), &b.points, how)?;
    Ok(json!({ "changed": changed }))
}

/// Undo depth, volumes, drawn slices.
pub(super) fn state(desk: &Desk) -> Value {
    let (past, future) = desk.steps();
    let drawn: Vec<Value> = (0..8u8)
        .flat_map(|label| Axis::ALL.map(|axis| (label, axis)))
        .filter_map(|(label, axis)| {
            let slices = desk.drawn_slices(axis, label);
            (!slices.is_empty()).then(|| json!({ "label": label, "axis": axis.number(), "slices": slices }))
        })
        .collect();
    json!({ "past": past, "future": future, "volumes_ml": desk.volumes_ml(), "drawn": drawn })
}

/// The open wire, or null.
pub(super) fn wire(desk: &Desk) -> Value {
    desk.open_wire().map_or(
        Value::Null,
        |w| json!({ "axis": w.axis.number(), "slice": w.index, "fixed": w.fixed, "anchors": w.anchors }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_that_is_not_understood_is_answered_under_its_number_or_the_page_waits_forever() {
        // A seed left of the image, a value beyond 16 bits, an unknown wish, no message at all.
        let seed = r#"{"id":7,"op":"preview","tool":{"name":"grow","seed":[-3,1,2],"range":[0,9],"neck_mm":1,"most_ml":1},"target":{"label":5}}"#;
        let value = r#"{"id":8,"op":"preview","tool":{"name":"threshold","range":[0,40000]},"target":{"label":5}}"#;
        for (text, id) in [(seed, Some(7)), (value, Some(8)), (r#"{"id":9,"op":"dance"}"#, Some(9)), ("{", None)] {
            let said = parse(text).expect_err("not understood");
            assert_eq!(said["id"].as_u64(), id, "{said}");
            assert!(said["error"].as_str().is_some_and(|e| e.starts_with("not understood: ")), "{said}");
        }
        assert_eq!(parse(r#"{"id":3,"op":"undo"}"#).expect("understood").id, 3);
    }
}
