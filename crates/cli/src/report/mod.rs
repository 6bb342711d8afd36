//! The report: one HTML page that holds everything it shows, opens without a network and prints.

mod page;
mod plot;
mod scale;

pub use page::{Finding, KeyNumber, ReportInput, Section, Severity, Table, report_html};
pub use plot::{Histogram, LinePlot, Series, quantile};
