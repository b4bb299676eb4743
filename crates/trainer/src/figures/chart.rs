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
/// Size of titles and of the text at the axes.
const TITLE: (&str, u32) = ("sans-serif", 15);
const TEXT: (&str, u32) = ("sans-serif", 12);

/// Draws charts side by side into `path` (SVG), the data beside it as CSV with the columns chart, curve, x, y.
///
/// # Errors
/// [`Error`].
pub fn charts(path: &Path, charts: &[Chart]) -> Result<(), Error> {
    let mut svg = String::new();
    let size = (SIZE.0 * charts.len().max(1) as u32, SIZE.1);
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(|e| Error::draw(path, &e))?;
        for (area, chart) in root
            .split_evenly((1, charts.len().max(1)))
            .iter()
            .zip(charts)
        {
            draw(area, chart).map_err(|e| Error::draw(path, &e))?;
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

fn draw<'a>(area: &Area<'a>, chart: &Chart) -> Drawn<'a> {
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
        .y_label_formatter(&power)
        .draw()?;
    for (index, curve) in chart.curves.iter().enumerate() {
        let colour = Palette99::pick(index).to_rgba();
        let points = curve.points.iter().filter_map(shown);
        context
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
            .label(&curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
    }
    if chart.curves.len() > 1 {
        context
            .configure_series_labels()
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.2))
            .label_font(TEXT)
            .draw()?;
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
