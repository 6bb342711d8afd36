//! Results as text for people: lines of quantities and aligned tables, from the very JSON that `--json` prints.

use serde_json::{Map, Value};

/// Ends of names that are units.
const UNITS: [(&str, &str); 13] = [
    ("_mm3", "mm3"),
    ("_mm2", "mm2"),
    ("_mm", "mm"),
    ("_ml", "ml"),
    ("_deg", "degrees"),
    ("_px", "px"),
    ("_per_s", "/s"),
    ("_ms", "ms"),
    ("_hz", "Hz"),
    ("_mib", "MiB"),
    ("_percent", "%"),
    ("_N", "N"),
    ("_s", "s"),
];

/// A value with as many digits as say something: four.
pub(crate) fn short(v: &Value) -> String {
    match v {
        Value::Null => "-".into(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.into(),
        Value::String(text) => text.clone(),
        Value::Array(all) => format!("({})", all.iter().map(short).collect::<Vec<_>>().join(", ")),
        Value::Object(all) => all.iter().map(|(k, v)| named(k, v, " ")).collect::<Vec<_>>().join(", "),
        Value::Number(n) if n.is_f64() => digits(n.as_f64().unwrap_or(f64::NAN)),
        Value::Number(n) => n.to_string(),
    }
}

/// Four digits, of whole numbers none behind the point, and no exponent where there is another way.
pub(crate) fn digits(v: f64) -> String {
    if v == v.round() || !v.is_finite() {
        return format!("{v:.0}");
    }
    if v.abs() < 1e-4 {
        return format!("{v:.1e}");
    }
    let whole = v.abs().log10().floor() as i32 + 1;
    format!("{v:.*}", usize::try_from(4 - whole).unwrap_or(0))
}

/// `tip_mm` and its value: "tip: 1.2 mm".
fn named(key: &str, v: &Value, between: &str) -> String {
    let (name, unit) = UNITS
        .iter()
        .find_map(|(end, unit)| key.strip_suffix(end).map(|name| (name, *unit)))
        .filter(|(name, _)| !name.is_empty())
        .unwrap_or((key, ""));
    format!("{}{between}{} {unit}", name.replace('_', " "), short(v)).trim_end().to_owned()
}

/// Whether it is shown as a table: rows of quantities.
fn is_table(v: &Value) -> bool {
    v.as_array().is_some_and(|rows| !rows.is_empty() && rows.iter().all(Value::is_object))
}

/// A line for each quantity, its unit behind it, and a table for each list of objects.
pub(crate) fn lines(result: &Value) -> String {
    let Value::Object(all) = result else { return short(result) };
    let block = |(key, v): (&String, &Value)| match v.as_array() {
        Some(rows) if is_table(v) => format!("{}:\n{}", key.replace('_', " "), table(rows, &own_columns(rows))),
        _ => named(key, v, ": "),
    };
    all.iter().map(block).collect::<Vec<_>>().join("\n")
}

/// A column: its heading with the unit, the JSON pointer into a row, and what numbers are multiplied by.
pub(crate) struct Column {
    heading: String,
    pointer: String,
    times: f64,
}

/// A column of numbers or words as they are.
pub(crate) fn column(heading: &str, pointer: &str) -> Column {
    Column { heading: heading.into(), pointer: pointer.into(), times: 1.0 }
}

/// A column of shares, in percent.
pub(crate) fn percent(heading: &str, pointer: &str) -> Column {
    Column { times: 100.0, ..column(heading, pointer) }
}

/// All quantities of the rows, in their order.
fn own_columns(rows: &[Value]) -> Vec<Column> {
    let mut keys: Vec<&String> = Vec::new();
    for (key, v) in rows.iter().filter_map(Value::as_object).flat_map(Map::iter) {
        if !v.is_object() && !is_table(v) && !keys.contains(&key) {
            keys.push(key);
        }
    }
    keys.into_iter().map(|key| column(&key.replace('_', " "), &format!("/{key}"))).collect()
}

/// One line a row, columns aligned: words to the left, numbers to the right. Columns without any value are left out.
pub(crate) fn table(rows: &[Value], columns: &[Column]) -> String {
    let cell = |row: &Value, c: &Column| match row.pointer(&c.pointer) {
        Some(v) if c.times != 1.0 && v.is_number() => digits(v.as_f64().unwrap_or(f64::NAN) * c.times),
        Some(v) => short(v),
        None => "-".into(),
    };
    let filled = |c: &&Column| rows.iter().any(|r| r.pointer(&c.pointer).is_some_and(|v| !v.is_null()));
    let columns: Vec<&Column> = columns.iter().filter(filled).collect();
    let head = columns.iter().map(|c| c.heading.clone()).collect();
    let body = rows.iter().map(|r| columns.iter().map(|c| cell(r, c)).collect());
    let cells: Vec<Vec<String>> = std::iter::once(head).chain(body).collect();
    let word = |i: usize| rows.iter().any(|r| r.pointer(&columns[i].pointer).is_some_and(Value::is_string));
    let width = |i: usize| cells.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
    let line = |row: &Vec<String>| {
        let pad = |(i, cell): (usize, &String)| match word(i) {
            true => format!("{cell:<0$}", width(i)),
            false => format!("{cell:>0$}", width(i)),
        };
        row.iter().enumerate().map(pad).collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    cells.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn quantities_had_sixteen_digits_and_no_unit() {
        let found = json!({ "tip_mm": [1.234_567_8, -200.123_45, 0.0], "poses": 12, "used": true, "tiny": 1.234e-9 });
        let told = lines(&found);
        for line in ["poses: 12", "tiny: 1.2e-9", "tip: (1.235, -200.1, 0) mm", "used: yes"] {
            assert!(told.lines().any(|l| l == line), "{line} is not in {told}");
        }
        assert_eq!([12_345.678, 0.001_234].map(digits), ["12346", "0.001234"]);
    }

    #[test]
    fn rows_are_aligned_and_empty_columns_are_left_out() {
        let rows = [json!({ "name": "a", "n": 5, "in": { "share": 0.5 } }), json!({ "name": "long", "n": 12_000 })];
        let columns = [column("name", "/name"), column("n", "/n"), percent("share %", "/in/share"), column("x", "/x")];
        assert_eq!(table(&rows, &columns), "name      n  share %\na         5       50\nlong  12000        -");
        let all = lines(&json!({ "rows": rows }));
        assert!(all.starts_with("rows:\n") && all.contains("long"), "{all}");
    }
}
