//! Tables of numbers, as spreadsheets and scripts write them: one row a line, blanks, commas or tabs between, `#` comments.

use anyhow::{Context, Result, bail};
use monro_geometry::{Frame, Point};
use std::path::Path;

/// The lines with something on them, with their numbers.
fn lines(path: &Path) -> Result<Vec<(usize, String)>> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    // Spreadsheets begin their files with a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let content = |l: &str| l.split('#').next().unwrap_or("").trim().to_owned();
    Ok((1..).zip(text.lines().map(content)).filter(|(_, l)| !l.is_empty()).collect())
}

/// Where semicolons separate, commas are decimal: so spreadsheets of many countries write.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let text = if text.contains(';') { text.replace(',', ".") } else { text.to_owned() };
    let words = text.split([',', ';', ' ', '\t']).filter(|w| !w.is_empty());
    let all: Vec<f64> = words.map(str::parse).collect::<Result<_, _>>().ok()?;
    all.try_into().ok().filter(|v: &[f64; N]| v.iter().all(|v| v.is_finite()))
}

/// Whether a word is meant for a number, a wrong one too.
fn is_number(word: &str) -> bool {
    let word = word.trim_matches('"');
    word.parse::<f64>().is_ok() || word.trim_start_matches(['-', '+', '.']).starts_with(|c: char| c.is_ascii_digit())
}

/// Whether a line is a heading, whose columns, where it names the axes, must be in order.
fn is_heading(line: &str, first: usize) -> Result<bool> {
    let words: Vec<&str> = line.split([',', ';', ' ', '\t']).filter(|w| !w.is_empty()).collect();
    if words.iter().skip(first).any(|w| is_number(w)) || !line.starts_with(|c: char| c.is_alphabetic() || c == '"') {
        return Ok(false);
    }
    let axis = |w: &&str| w.trim_matches('"').to_ascii_lowercase().chars().next().filter(|c| "xyz".contains(*c));
    let axes: String = words.iter().skip(first).filter_map(axis).collect();
    match axes.as_str() {
        "xzy" | "yxz" | "yzx" | "zxy" | "zyx" => {
            bail!("the heading '{line}' has the axes as {axes}; they are read as x, y, z: reorder the columns")
        }
        _ => Ok(true),
    }
}

/// Rows of `N` numbers; `wanted` names them for the message. A first row of words is a heading.
pub(crate) fn rows<const N: usize>(path: &Path, wanted: &str) -> Result<Vec<[f64; N]>> {
    let mut out = Vec::new();
    for (i, (number, line)) in lines(path)?.iter().enumerate() {
        match numbers(line) {
            Some(row) => out.push(row),
            None if i == 0 && is_heading(line, 0).with_context(|| path.display().to_string())? => {}
            None => bail!("{}, line {number}: '{line}' is not {wanted}", path.display()),
        }
    }
    Ok(out)
}

/// Rows of a name and three numbers, mm. The name may hold blanks when commas, semicolons or tabs separate. A first row with
/// no number behind its first word is a heading.
pub(crate) fn named_points<F: Frame>(path: &Path) -> Result<Vec<(String, Point<F>)>> {
    let one = |(number, line): (usize, String)| {
        let read = named(&line).map(|(name, at)| (name, Point::from_array(at)));
        read.with_context(|| format!("{}, line {number}: '{line}' is not NAME,X,Y,Z", path.display()))
    };
    let mut lines = lines(path)?;
    let heading =
        lines.first().map(|(_, l)| is_heading(l, 1)).transpose().with_context(|| path.display().to_string())?;
    lines.drain(..usize::from(heading == Some(true)));
    lines.into_iter().map(one).collect()
}

fn named(line: &str) -> Option<(String, [f64; 3])> {
    let separator = [';', '\t', ','].into_iter().find(|s| line.contains(*s));
    let (name, rest) = match separator {
        Some(s) => line.split_once(s)?,
        None => line.split_once(char::is_whitespace)?,
    };
    // The separator of the whole line stays with the numbers: it says what their commas are.
    let rest = if separator == Some(';') { format!("{rest};") } else { rest.to_owned() };
    Some((name.trim().trim_matches('"').trim().to_owned(), numbers(&rest)?))
}

/// `X,Y,Z`, mm.
pub(crate) fn point<F: Frame>(text: &str) -> Result<Point<F>> {
    numbers(text).map(Point::from_array).with_context(|| format!("'{text}' is not X,Y,Z"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Tool;

    #[test]
    fn tables_are_read_however_they_are_separated_and_faults_have_their_line() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("t.csv");
        std::fs::write(&path, "x,y,z\n1,2,3 # first\n\n4 5\t6\n").expect("write");
        assert_eq!(rows::<3>(&path, "x y z").expect("rows"), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        std::fs::write(&path, "1 2 3\n1 2\n").expect("write");
        assert!(rows::<3>(&path, "x y z").expect_err("short").to_string().contains("line 2: '1 2' is not x y z"));
        std::fs::write(&path, "left tragus, -1.5, 2, 3\nnasion 0 1 2\n").expect("write");
        let points = named_points::<Tool>(&path).expect("points");
        assert_eq!(points[0], ("left tragus".to_owned(), Point::new(-1.5, 2.0, 3.0)));
        assert_eq!(points[1].0, "nasion");
        std::fs::write(&path, "\u{feff}name;x1;y1;z1\n\"left tragus\"; -1,5; 2;3\nnasion;0;1,25;2\n").expect("write");
        let points = named_points::<Tool>(&path).expect("points");
        assert_eq!(points[0], ("left tragus".to_owned(), Point::new(-1.5, 2.0, 3.0)));
        assert_eq!(points[1], ("nasion".to_owned(), Point::new(0.0, 1.25, 2.0)));
        assert!(point::<Tool>("1,2").is_err());
    }

    #[test]
    fn headings_with_other_columns_and_bad_first_rows_were_dropped_without_a_word() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("t.csv");
        let fault = |text: &str| {
            std::fs::write(&path, text).expect("write");
            let named = named_points::<Tool>(&path).map(|p| p.len());
            let plain = rows::<3>(&path, "x y z").map(|r| r.len());
            [named, plain].map(|r| r.map_err(|e| format!("{e:#}")))
        };
        let [named, _] = fault("name,y,z,x\nnasion,1,2,3\n");
        assert!(named.expect_err("order").contains("axes as yzx"));
        let [named, _] = fault("midline above nasion,310.6355mm,743.1mm,-24.1mm\nnasion,1,2,3\n");
        assert!(named.expect_err("no heading").contains("line 1"));
        assert_eq!(fault("point,x [mm],y [mm],z [mm]\nnasion,1,2,3\n")[0], Ok(1));
        let [_, plain] = fault("nan nan nan\n1 2 3\n");
        assert!(plain.expect_err("no heading").contains("line 1"));
        let [_, plain] = fault("z y x\n1 2 3\n");
        assert!(plain.expect_err("order").contains("axes as zyx"));
        assert_eq!(fault("x y z\n1 2 3\n")[1], Ok(1));
    }
}
