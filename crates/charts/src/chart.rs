//! Curves over one axis, several charts on a sheet.

use super::sheet::{Area, Drawn, FONT, Key, Sheet, rgb, text};
use super::{Drawing, Error, field, range};
use core::fmt::Write as _;
use plotters::prelude::*;

/// A named curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// For the legend.
    pub name: String,
    /// x and y; points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// Curves with their axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Above the chart.
    pub title: String,
    /// Below the horizontal axis.
    pub x_label: String,
    /// Beside the vertical axis.
    pub y_label: String,
    /// Powers of ten on the vertical axis; values that are not positive are left out.
    pub logarithmic: bool,
    /// Values above are left out, as Figure 10 does; below the charts they are told.
    pub ceiling: Option<f64>,
    /// The curves.
    pub curves: Vec<Curve>,
    /// A colour (red, green, blue) a curve; none: by the curves' places.
    pub colours: Vec<[u8; 3]>,
    /// Below the charts, once.
    pub note: String,
}

/// Size of one chart, pixels.
const SIZE: (u32, u32) = (460, 370);
/// Width of the legend, the height of one of its lines and of a line below the charts.
const LEGEND: u32 = 176;
const LINE: u32 = 24;
/// Up to so many points of a curve are drawn as dots too.
const FEW: usize = 12;
/// Values above the ceiling that are told.
const TOLD: usize = 6;
/// Size of titles and of the text at the axes.
const TITLE: (&str, u32) = (FONT, 17);
const TEXT: (&str, u32) = (FONT, 14);

/// Draws charts with one legend; their data has the columns chart, curve, x, y.
///
/// # Errors
/// [`Error`].
pub fn charts(charts: &[Chart]) -> Result<Drawing, Error> {
    let legend = legend(charts);
    let notes = notes(charts);
    let columns = match charts.len() {
        few @ 0..=3 => few.max(1),
        4 => 2,
        _ => 3,
    };
    let sheet = Sheet {
        size: SIZE,
        right: if legend.len() > 1 { LEGEND } else { 0 },
        below: match notes.len() {
            0 => 0,
            lines => LINE * lines as u32 + 6,
        },
    };
    let rows: Vec<Vec<&Chart>> = charts
        .chunks(columns)
        .map(|row| row.iter().collect())
        .collect();
    let each = |area: &Area<'_>, chart: &&Chart| draw(area, chart, &legend);
    let svg = sheet.draw(&rows, each, |beside, below| {
        if sheet.right > 0 {
            for (place, key) in legend.iter().enumerate() {
                key.draw(beside, (4, 48 + (LINE as usize * place) as i32), TEXT.1)?;
            }
        }
        for (place, note) in notes.iter().enumerate() {
            text(below, note, (14, 12 + (LINE as usize * place) as i32), 13)?;
        }
        Ok(())
    })?;
    let mut csv = String::from("chart,curve,x,y\n");
    for chart in charts {
        for curve in &chart.curves {
            for (x, y) in &curve.points {
                let _ = writeln!(
                    csv,
                    "{},{},{x},{y}",
                    field(&chart.title),
                    field(&curve.name)
                );
            }
        }
    }
    Ok(Drawing { svg, csv })
}

/// Every curve's name once, in the order in which they come, with its colour: one legend for all charts, beside them, where it hides
/// no curve.
fn legend(charts: &[Chart]) -> Vec<Key> {
    let mut keys: Vec<Key> = Vec::new();
    for chart in charts {
        for (place, curve) in chart.curves.iter().enumerate() {
            if keys.iter().all(|key| key.text != curve.name) {
                let own = chart.colours.get(place).copied();
                keys.push(Key::line(
                    &curve.name,
                    own.unwrap_or_else(|| colour(keys.len())),
                ));
            }
        }
    }
    keys
}

/// What stands below: the charts' notes, each once, and what is above a ceiling.
fn notes(charts: &[Chart]) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    for chart in charts {
        if !chart.note.is_empty() && !notes.contains(&chart.note) {
            notes.push(chart.note.clone());
        }
    }
    for chart in charts {
        let Some(ceiling) = chart.ceiling else {
            continue;
        };
        let mut above = Vec::new();
        for curve in &chart.curves {
            let high = curve
                .points
                .iter()
                .filter(|(_, y)| y.is_finite() && *y > ceiling);
            above.extend(high.map(|(x, y)| format!("({}, {}, {y:.1})", curve.name, short(*x))));
        }
        if above.is_empty() {
            continue;
        }
        let more = match above.len().saturating_sub(TOLD) {
            0 => String::new(),
            more => format!(" and {more} more, see the CSV file"),
        };
        above.truncate(TOLD);
        let above = above.join(", ");
        let (title, ceiling) = (&chart.title, short(ceiling));
        notes.push(format!(
            "{title}: above {ceiling}, not drawn: {above}{more}"
        ));
    }
    notes
}

/// Colours that people with any kind of colour vision tell apart (those of Okabe and Ito, but for yellow).
fn colour(place: usize) -> [u8; 3] {
    const COLOURS: [[u8; 3]; 8] = [
        [0, 114, 178],
        [213, 94, 0],
        [0, 158, 115],
        [204, 121, 167],
        [230, 159, 0],
        [86, 180, 233],
        [130, 130, 130],
        [0, 0, 0],
    ];
    COLOURS[place % COLOURS.len()]
}

fn draw(area: &Area<'_>, chart: &Chart, legend: &[Key]) -> Drawn {
    let shown = |&(x, y): &(f64, f64)| {
        let below = chart.ceiling.is_none_or(|ceiling| y <= ceiling);
        let y = if chart.logarithmic { libm::log10(y) } else { y };
        (below && x.is_finite() && y.is_finite()).then_some((x, y))
    };
    let all: Vec<(f64, f64)> = (chart.curves.iter())
        .flat_map(|curve| curve.points.iter().filter_map(shown))
        .collect();
    let (left, right) = range(all.iter().map(|p| p.0));
    let (low, high) = range(all.iter().map(|p| p.1));
    // Whole powers of ten, so that there are labels.
    let (low, high) = match chart.logarithmic {
        true => (libm::floor(low), libm::ceil(high)),
        false => (low, high),
    };
    let mut context = ChartBuilder::on(area)
        .caption(&chart.title, TITLE)
        .margin(8)
        .margin_right(14)
        .x_label_area_size(42)
        .y_label_area_size(64)
        .build_cartesian_2d(left..right, low..high)?;
    let power = |y: &f64| {
        short(if chart.logarithmic {
            libm::pow(10.0, *y)
        } else {
            *y
        })
    };
    let lines = BLACK.mix(0.14);
    context
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(lines)
        .x_desc(&chart.x_label)
        .y_desc(&chart.y_label)
        .axis_desc_style(TEXT)
        .label_style(TEXT)
        .x_labels(11)
        .x_label_formatter(&|x| short(*x))
        .y_labels(if chart.logarithmic {
            (high - low) as usize + 1
        } else {
            8
        })
        .y_label_formatter(&power)
        .draw()?;
    if chart.logarithmic {
        // The multiples between the powers show which kind of axis it is.
        let powers = low as i32..high as i32;
        let between = powers.flat_map(|power| (2..10).map(move |m| (power, m)));
        context.draw_series(between.map(|(power, multiple)| {
            let y = f64::from(power) + libm::log10(f64::from(multiple));
            PathElement::new(vec![(left, y), (right, y)], BLACK.mix(0.05))
        }))?;
    }
    for curve in &chart.curves {
        let key = legend.iter().find(|key| key.text == curve.name);
        let colour = rgb(key.map_or([0, 0, 0], |key| key.colour));
        let points: Vec<(f64, f64)> = curve.points.iter().filter_map(shown).collect();
        // A single point would be a line of no length.
        let dots = points.iter().map(|&p| Circle::new(p, 3, colour.filled()));
        if points.len() <= FEW {
            context.draw_series(dots)?;
        }
        context.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
    }
    Ok(())
}

/// Three digits, without trailing zeros.
fn short(value: f64) -> String {
    let size = libm::fabs(value);
    if size >= 1e5 || (size > 0.0 && size < 1e-3) {
        return format!("{value:.1e}");
    }
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}
