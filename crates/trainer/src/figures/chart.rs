//! Curves over one axis, several charts side by side.

use super::{Error, field, range, write};
use core::fmt::Write as _;
use plotters::prelude::*;
use std::path::Path;

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
    /// Values above are left out, as Figure 10 does.
    pub ceiling: Option<f64>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// Size of one chart, pixels.
const SIZE: (u32, u32) = (460, 360);
/// Width of the legend.
const LEGEND: u32 = 150;
/// Up to so many points of a curve are drawn as dots too.
const FEW: usize = 12;
/// Size of titles and of the text at the axes.
const TITLE: (&str, u32) = ("sans-serif", 15);
const TEXT: (&str, u32) = ("sans-serif", 12);

/// Draws charts side by side into `path` (SVG), the data beside it as CSV with the columns chart, curve, x, y.
///
/// # Errors
/// [`Error`].
pub fn charts(path: &Path, charts: &[Chart]) -> Result<(), Error> {
    let mut svg = String::new();
    let names = names(charts);
    let width = SIZE.0 * charts.len().max(1) as u32;
    let legend_width = if names.len() > 1 { LEGEND } else { 0 };
    {
        let size = (width + legend_width, SIZE.1);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(|e| Error::draw(path, &e))?;
        let (drawn, beside) = root.split_horizontally(width);
        for (area, chart) in drawn
            .split_evenly((1, charts.len().max(1)))
            .iter()
            .zip(charts)
        {
            draw(area, chart, &names).map_err(|e| Error::draw(path, &e))?;
        }
        if legend_width > 0 {
            legend(&beside, &names).map_err(|e| Error::draw(path, &e))?;
        }
        root.present().map_err(|e| Error::draw(path, &e))?;
    }
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
    write(path, &svg, &csv)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn<'a> = Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

/// Every curve's name once, in the order in which they come: its place decides its colour.
fn names(charts: &[Chart]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for curve in charts.iter().flat_map(|chart| &chart.curves) {
        if !names.contains(&curve.name.as_str()) {
            names.push(&curve.name);
        }
    }
    names
}

/// One legend for all charts, beside them, where it hides no curve.
fn legend<'a>(area: &Area<'a>, names: &[&str]) -> Drawn<'a> {
    for (place, name) in names.iter().enumerate() {
        let y = 40 + 22 * place as i32;
        let line = PathElement::new([(4, y), (26, y)], colour(place).stroke_width(3));
        area.draw(&line)?;
        let style = TEXT.into_font().color(&BLACK);
        area.draw(&Text::new((*name).to_owned(), (32, y - 7), style))?;
    }
    Ok(())
}

fn colour(place: usize) -> RGBColor {
    const COLOURS: [(u8, u8, u8); 8] = [
        (130, 130, 130),
        (170, 110, 40),
        (220, 160, 0),
        (60, 150, 60),
        (40, 110, 200),
        (130, 40, 160),
        (210, 30, 30),
        (0, 160, 170),
    ];
    let (red, green, blue) = COLOURS[place % COLOURS.len()];
    RGBColor(red, green, blue)
}

fn draw<'a>(area: &Area<'a>, chart: &Chart, names: &[&str]) -> Drawn<'a> {
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
    // Room for a whole power of ten at least, so that there are labels.
    let (low, high) = match chart.logarithmic {
        true => (libm::floor(low), libm::ceil(high)),
        false => (low, high),
    };
    let mut context = ChartBuilder::on(area)
        .caption(&chart.title, TITLE)
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(52)
        .build_cartesian_2d(left..right, low..high)?;
    let power = |y: &f64| {
        short(if chart.logarithmic {
            libm::pow(10.0, *y)
        } else {
            *y
        })
    };
    context
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(BLACK.mix(0.12))
        .x_desc(&chart.x_label)
        .y_desc(&chart.y_label)
        .label_style(TEXT)
        .x_label_formatter(&|x| short(*x))
        .y_labels(if chart.logarithmic {
            (high - low) as usize + 1
        } else {
            8
        })
        .y_label_formatter(&power)
        .draw()?;
    for curve in &chart.curves {
        let place = names.iter().position(|name| *name == curve.name);
        let colour = colour(place.unwrap_or(0));
        let points: Vec<(f64, f64)> = curve.points.iter().filter_map(shown).collect();
        // A single point would be a line of no length.
        let dots = points.iter().map(|&p| Circle::new(p, 2, colour.filled()));
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
