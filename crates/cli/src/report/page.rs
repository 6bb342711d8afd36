//! The page around figures, tables and findings.

use crate::picture::{Figure, escape};
use monro_guidance::Side;

/// A number that matters, shown large.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyNumber {
    /// What it is.
    pub name: String,
    /// The number, already in words that suit it.
    pub value: String,
    /// Its unit; empty for none.
    pub unit: String,
    /// What it depends on or how good it is; empty for nothing.
    pub note: String,
}

impl KeyNumber {
    /// A number without a note.
    pub fn new(name: &str, value: impl Into<String>, unit: &str) -> Self {
        Self { name: name.to_owned(), value: value.into(), unit: unit.to_owned(), note: String::new() }
    }

    /// The same with a note.
    #[must_use]
    pub fn noted(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }
}

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// Worth knowing.
    Note,
    /// The result may be worse than usual.
    Warning,
    /// The result must not be relied on.
    Error,
}

impl Severity {
    const fn words(self) -> [&'static str; 2] {
        match self {
            Self::Note => ["note", "Note"],
            Self::Warning => ["warning", "Warning"],
            Self::Error => ["error", "Error"],
        }
    }
}

/// Something that the reader must know.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// One sentence with numbers.
    pub text: String,
}

/// A table. Cells that start like a number are set to the right.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Title; empty for none.
    pub caption: String,
    /// Column heads, units included.
    pub head: Vec<String>,
    /// Rows of as many cells.
    pub rows: Vec<Vec<String>>,
}

/// A part of the report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// Paragraphs before tables and figures.
    pub text: Vec<String>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Figures.
    pub figures: Vec<Figure>,
}

/// Everything a report shows.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportInput {
    /// Title of the page.
    pub title: String,
    /// The patient's pseudonym, never a name; empty where there is no case.
    pub pseudonym: String,
    /// Side of the entry, where there is one.
    pub side: Option<Side>,
    /// More lines below the title: source, date, settings.
    pub details: Vec<String>,
    /// Numbers shown large.
    pub key_numbers: Vec<KeyNumber>,
    /// Warnings and notes.
    pub findings: Vec<Finding>,
    /// The parts, in order.
    pub sections: Vec<Section>,
    /// What wrote the report, with its version.
    pub written_by: String,
}

/// Figures wider than this many pixels take a whole row.
const WIDE: f64 = 700.0;

/// The report as one HTML page. It refers to nothing outside itself, and says so to the browser.
pub fn report_html(input: &ReportInput) -> String {
    let title = escape(&input.title);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
         style-src 'unsafe-inline'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n<p>{}</p>\n</header>\n",
        include_str!("style.css"),
        subtitle(input)
    );
    out += "<div class=\"research\" role=\"note\">Research use only. Not for clinical use, diagnosis or treatment.</div>\n";
    out += &findings(&input.findings);
    out += &key_numbers(&input.key_numbers);
    for section in &input.sections {
        out += &section_html(section);
    }
    out += &format!("<footer>{}</footer>\n</body>\n</html>\n", escape(&input.written_by));
    out
}

fn subtitle(input: &ReportInput) -> String {
    let mut parts = Vec::new();
    if !input.pseudonym.is_empty() {
        parts.push(format!("Case {}", input.pseudonym));
    }
    parts.extend(input.side.map(|s| format!("entry on the patient's {}", s.name())));
    parts.extend(input.details.iter().cloned());
    parts.iter().map(|p| escape(p)).collect::<Vec<_>>().join(" &middot; ")
}

fn findings(findings: &[Finding]) -> String {
    if findings.is_empty() {
        return String::new();
    }
    let mut out = String::from("<ul class=\"findings\">\n");
    for f in findings {
        let [class, word] = f.severity.words();
        out += &format!("<li class=\"{class}\"><b>{word}:</b>{}</li>\n", escape(&f.text));
    }
    out + "</ul>\n"
}

fn key_numbers(numbers: &[KeyNumber]) -> String {
    if numbers.is_empty() {
        return String::new();
    }
    let mut out = String::from("<div class=\"keys\">\n");
    for k in numbers {
        let [name, value, unit, note] = [&k.name, &k.value, &k.unit, &k.note].map(|t| escape(t));
        let note = if note.is_empty() { note } else { format!("<div class=\"note\">{note}</div>") };
        out += &format!(
            "<div class=\"key\"><div class=\"name\">{name}</div><div class=\"value\">{value} \
             <span class=\"unit\">{unit}</span></div>{note}</div>\n"
        );
    }
    out + "</div>\n"
}

fn section_html(section: &Section) -> String {
    let mut out = format!("<section>\n<h2>{}</h2>\n", escape(&section.title));
    for paragraph in &section.text {
        out += &format!("<p>{}</p>\n", escape(paragraph));
    }
    if !section.tables.is_empty() {
        let tables: String = section.tables.iter().map(table_html).collect();
        out += &format!("<div class=\"tables\">\n{tables}</div>\n");
    }
    if !section.figures.is_empty() {
        out += "<div class=\"figures\">\n";
        for figure in &section.figures {
            let caption = escape(&figure.caption);
            let class = if figure.width > WIDE { " class=\"wide\"" } else { "" };
            out += &format!("<figure{class}>{}<figcaption>{caption}</figcaption></figure>\n", figure.inline());
        }
        out += "</div>\n";
    }
    out + "</section>\n"
}

fn table_html(table: &Table) -> String {
    let mut out = String::from("<table>\n");
    if !table.caption.is_empty() {
        out += &format!("<caption>{}</caption>\n", escape(&table.caption));
    }
    let numeric = |column: usize| {
        let cells = || table.rows.iter().filter_map(|r| r.get(column)).filter(|c| !c.is_empty());
        cells().next().is_some() && cells().all(|c| is_numeric(c))
    };
    let class = |column: usize| if numeric(column) { " class=\"number\"" } else { "" };
    if !table.head.is_empty() {
        let heads: String =
            table.head.iter().enumerate().map(|(i, h)| format!("<th{}>{}</th>", class(i), escape(h))).collect();
        out += &format!("<thead><tr>{heads}</tr></thead>\n");
    }
    out += "<tbody>\n";
    for row in &table.rows {
        let cells: String =
            row.iter().enumerate().map(|(i, c)| format!("<td{}>{}</td>", class(i), escape(c))).collect();
        out += &format!("<tr>{cells}</tr>\n");
    }
    out + "</tbody>\n</table>\n"
}

fn is_numeric(cell: &str) -> bool {
    let first = cell.split_whitespace().next().unwrap_or("");
    first.parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::super::plot::{LinePlot, Series};
    use super::*;
    use crate::picture::{Colour, Image};

    fn full() -> ReportInput {
        let uri = Image::new(4, 4, Colour::SKY).data_uri().unwrap();
        let picture = Figure {
            width: 4.0,
            height: 4.0,
            content: format!("<image width=\"4\" height=\"4\" href=\"{uri}\"/>"),
            caption: "a <picture>".into(),
        };
        let plot = LinePlot {
            series: vec![Series { name: "rigid & deformed".into(), points: vec![[0.0, 1.0], [1.0, 2.0]] }],
            ..LinePlot::default()
        };
        ReportInput {
            title: "Insertion <script>alert(1)</script>".into(),
            pseudonym: "P-\"7\"".into(),
            side: Some(Side::Right),
            details: vec!["head CT".into()],
            key_numbers: vec![KeyNumber::new("Tip error", "1.2", "mm").noted("rigid < deformed")],
            findings: vec![Finding { severity: Severity::Warning, text: "slices 3 & 4 are 5 mm apart".into() }],
            sections: vec![Section {
                title: "Figures".into(),
                text: vec!["x > y".into()],
                tables: vec![Table {
                    caption: "Volumes".into(),
                    head: vec!["structure".into(), "mL".into()],
                    rows: vec![vec!["brain".into(), "1200.5".into()], vec!["skull".into(), "600".into()]],
                }],
                figures: vec![picture, plot.figure()],
            }],
            written_by: "monro 0.1.0".into(),
        }
    }

    /// Names of the tags that stay open at the end, or close without being open.
    fn unbalanced(html: &str) -> Vec<String> {
        let mut open: Vec<String> = Vec::new();
        let mut wrong = Vec::new();
        for tag in html.split('<').skip(1).map(|t| t.split('>').next().unwrap_or("")) {
            let name: String = tag.trim_start_matches('/').chars().take_while(|c| c.is_ascii_alphanumeric()).collect();
            if tag.starts_with('!') || tag.ends_with('/') || name == "meta" {
                continue;
            }
            if !tag.starts_with('/') {
                open.push(name);
            } else if open.pop().as_ref() != Some(&name) {
                wrong.push(name);
            }
        }
        wrong.extend(open);
        wrong
    }

    #[test]
    fn the_page_refers_to_nothing_outside_itself() {
        let html = report_html(&full());
        for reference in ["http://", "https://", "//cdn", "<script", "<link", "<iframe", "@import", "url(", "src="] {
            assert!(!html.contains(reference), "{reference}");
        }
        for href in html.split("href=\"").skip(1) {
            assert!(href.starts_with("data:image/png;base64,"));
        }
        assert!(html.contains("default-src 'none'"));
    }

    #[test]
    fn all_text_is_escaped_and_all_tags_are_closed() {
        let html = report_html(&full());
        for text in [
            "Insertion &lt;script&gt;",
            "P-&quot;7&quot;",
            "rigid &lt; deformed",
            "slices 3 &amp; 4",
            "a &lt;picture&gt;",
            "rigid &amp; deformed",
            "Research use only",
            "entry on the patient&#39;s right",
        ] {
            assert!(html.contains(text), "{text}");
        }
        assert_eq!(unbalanced(&html), Vec::<String>::new());
        assert!(html.contains("<td>brain</td><td class=\"number\">1200.5</td>"));
    }

    #[test]
    fn an_empty_report_is_a_page_too() {
        let html = report_html(&ReportInput {
            title: String::new(),
            pseudonym: String::new(),
            side: None,
            details: vec![],
            key_numbers: vec![],
            findings: vec![],
            sections: vec![Section::default()],
            written_by: String::new(),
        });
        assert_eq!(unbalanced(&html), Vec::<String>::new());
    }
}
