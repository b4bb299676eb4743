//! Tables 2 and 4 as text and CSV.

use std::fmt::Write as _;

use crate::plan::Frame;
use crate::printed::{self, MEASURES};
use crate::{Cell, Entry, Row, Source, Table};
use trainer::algorithm::Schedule;

/// What the paper's text has lost, and what there is not.
const NONE: &str = "—";

/// A table as a person reads it: ours beside the paper's.
pub fn text(table: &Table, frame: &Frame) -> String {
    let mut text = String::new();
    let seeds = frame.seeds;
    let _ = writeln!(
        text,
        "{}: {seeds} repetition{}, held-out samples",
        title(table.source),
        if seeds == 1 { "" } else { "s" }
    );
    let _ = writeln!(
        text,
        "{:<20} {:<6}│ {:>8} ± {:<7} {:>8} │ {:>8} ± {:<7} │ our median lies in",
        "cost", "", "mean", "dev.", "median", "paper", "dev."
    );
    let mut is_any_outside = false;
    for (row, entries) in &table.rows {
        for (measure, entry) in MEASURES.iter().zip(entries) {
            if entry.ours.is_none() && entry.paper.is_none() {
                continue;
            }
            let name = if *measure == MEASURES[0] {
                row.title()
            } else {
                ""
            };
            let _ = writeln!(text, "{name:<20} {} {}", padded(measure, 5), line(entry));
            is_any_outside |= entry.is_outside();
        }
    }
    if is_any_outside {
        text.push_str("← the median lies outside the range in which a right implementation lies");
        text.push_str(if frame.is_full() {
            "\n"
        } else {
            " with the paper's schedule and 5 repetitions or more: this run has less\n"
        });
    }
    let ours = Cell::of_table(table.source, Row::HaeStarts, 1);
    let schedule = match frame.schedule {
        Schedule::Paper => ", fast schedule",
        _ => "",
    };
    let _ = writeln!(
        text,
        "{}: N = {}{schedule}, not in the paper",
        ours.row.title(),
        ours.starts()
    );
    for order in table.orders() {
        let holds = if order.holds {
            "holds"
        } else {
            "does not hold"
        };
        let _ = writeln!(text, "means: {}: {holds}", order.what);
    }
    text.push_str(&tests(table));
    text.push('\n');
    text
}

/// Padded on the right by characters that take room: the bar over d is none.
fn padded(text: &str, width: usize) -> String {
    let shown = text.chars().filter(|c| *c != '\u{304}').count();
    format!("{text}{}", " ".repeat(width.saturating_sub(shown)))
}

fn title(source: Source) -> String {
    match source {
        Source::Shape(pair) => format!("{}, {}, 4 pairs", pair.name(), pair.description()),
        Source::Generated => "Hand, generated motion, 8 pairs".to_owned(),
        Source::Recorded => "Hand, the recording, 8 pairs".to_owned(),
    }
}

fn line(entry: &Entry) -> String {
    let ours = match entry.ours {
        Some(ours) => format!(
            "{:>8} ± {:<7} {:>8}",
            short(ours.mean),
            short(ours.deviation),
            short(ours.median)
        ),
        None => format!("{NONE:>8}   {:<7} {NONE:>8}", ""),
    };
    let paper = match entry.paper {
        Some(paper) => format!(
            "{:>8} ± {:<7}",
            short(paper.mean),
            paper.deviation.map_or(NONE.to_owned(), short)
        ),
        None => format!("{NONE:>8}   {:<7}", ""),
    };
    let range = entry.range.map_or(String::new(), |(low, high)| {
        match (low.is_finite(), high.is_finite()) {
            (true, true) => format!("{} to {}", short(low), short(high)),
            (true, false) => format!("≥ {}", short(low)),
            _ => format!("≤ {}", short(high)),
        }
    });
    let mark = if entry.is_outside() {
        "  ← outside"
    } else {
        ""
    };
    format!("│ {ours} │ {paper} │ {range}{mark}")
}

/// Three decimals for what is small, fewer for what is large.
fn short(value: f64) -> String {
    match value.abs() {
        _ if !value.is_finite() => NONE.to_owned(),
        size if size >= 1000.0 => format!("{value:.0}"),
        size if size >= 100.0 => format!("{value:.1}"),
        _ => format!("{value:.3}"),
    }
}

/// The t-tests of §3.2.3.
fn tests(table: &Table) -> String {
    let Source::Shape(pair) = table.source else {
        return String::new();
    };
    let papers = printed::P_VALUES[pair as usize];
    let mut text = String::new();
    let against = ["‖J‖² + Pin + BA", "Pin + BA"];
    for ((test, other), paper) in table.tests.iter().zip(against).zip(papers) {
        let ours = match test {
            Some(test) => format!(
                "p = {:.2e} (t = {:.2}, {} degrees of freedom)",
                test.p, test.t, test.freedom
            ),
            None => format!("p = {NONE} (needs two repetitions that differ)"),
        };
        let _ = writeln!(
            text,
            "d̄ of HAE (α=0) against {other}: {ours}; the paper {paper:.1e}"
        );
    }
    text
}

/// The same as CSV, a number a line.
pub fn csv(tables: &[Table]) -> String {
    let mut text = String::from(
        "data,cost,measure,repetitions,mean,median,deviation,quartile_1,quartile_3,paper_mean,paper_deviation,range_low,range_high,outside\n",
    );
    let number = |value: Option<f64>| match value {
        Some(value) if value.is_finite() => value.to_string(),
        _ => String::new(),
    };
    for table in tables {
        for (row, entries) in &table.rows {
            for (measure, entry) in MEASURES.iter().zip(entries) {
                let ours = entry.ours.as_ref();
                let fields = [
                    table.source.name().to_owned(),
                    row.slug().to_owned(),
                    (*measure).to_owned(),
                    ours.map_or(0, |ours| ours.count).to_string(),
                    number(ours.map(|ours| ours.mean)),
                    number(ours.map(|ours| ours.median)),
                    number(ours.map(|ours| ours.deviation)),
                    number(ours.map(|ours| ours.quartiles.0)),
                    number(ours.map(|ours| ours.quartiles.1)),
                    number(entry.paper.map(|paper| paper.mean)),
                    number(entry.paper.and_then(|paper| paper.deviation)),
                    number(entry.range.map(|range| range.0)),
                    number(entry.range.map(|range| range.1)),
                    entry.is_outside().to_string(),
                ];
                text.push_str(&fields.join(","));
                text.push('\n');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::printed::Printed;
    use crate::stats::summary;

    #[test]
    fn a_number_that_the_paper_lost_is_a_dash_and_a_median_outside_is_marked() {
        let entry = Entry {
            ours: summary(&[1.0, 2.0, 4.5]),
            paper: Some(Printed {
                mean: 4.813,
                deviation: None,
            }),
            range: Some((2.5, 5.0)),
        };
        let text = line(&entry);
        assert!(text.contains("4.813 ± —"), "{text}");
        assert!(text.ends_with("2.500 to 5.000  ← outside"), "{text}");
        let lost = Entry {
            paper: None,
            range: None,
            ..entry
        };
        assert!(
            line(&lost).contains("│        —           │"),
            "{}",
            line(&lost)
        );
    }

    #[test]
    fn columns_stand_under_each_other() {
        let entry = |mean| Entry {
            ours: summary(&[mean, mean * 1.1]),
            paper: Some(Printed {
                mean,
                deviation: Some(mean),
            }),
            range: None,
        };
        let width = |mean| line(&entry(mean)).chars().count();
        assert_eq!(width(0.01), width(547.117));
        assert_eq!(width(0.01), width(12345.6));
        assert_eq!(padded("d̄", 5).chars().count(), 6);
    }
}
