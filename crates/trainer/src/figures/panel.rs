//! Grids, clouds and marks in the plane or in space: shapes, the image of a map, its folds.

use super::{Error, field, range, write};
use crate::data::Matrix;
use core::fmt::Write as _;
use plotters::prelude::*;
use std::path::Path;

/// One drawing. Points have two or three columns; three are seen from above at an angle.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Above the drawing.
    pub title: String,
    /// Points of the grid.
    pub points: Matrix,
    /// Column and row of each of them: neighbours are joined by lines. Empty: dots.
    pub grid: Vec<[usize; 2]>,
    /// A value 0 to 1 a point, drawn as colour from blue to red.
    pub heat: Vec<f64>,
    /// Below the drawing; after the colours from first to last when points have values.
    pub note: String,
    /// Points of a closed line behind the grid.
    pub outline: Matrix,
    /// Dots behind the grid.
    pub cloud: Matrix,
    /// Points with a number beside them, from 1 on.
    pub marks: Matrix,
    /// Points joined by a line, in their order.
    pub path: Matrix,
}

/// Size of one panel, pixels.
const SIZE: (u32, u32) = (300, 320);

/// Draws rows of panels into `path` (SVG), the data beside it as CSV with the columns panel, kind, number, x, y, z, value.
///
/// # Errors
/// [`Error`].
pub fn panels(path: &Path, rows: &[Vec<Panel>]) -> Result<(), Error> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let count = rows.len().max(1);
    let size = (SIZE.0 * columns as u32, SIZE.1 * count as u32);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(|e| Error::draw(path, &e))?;
        let areas = root.split_evenly((count, columns));
        for (row, areas) in rows.iter().zip(areas.chunks(columns)) {
            for (panel, area) in row.iter().zip(areas) {
                draw(area, panel).map_err(|e| Error::draw(path, &e))?;
            }
        }
        root.present().map_err(|e| Error::draw(path, &e))?;
    }
    write(path, &svg, &data(rows))
}

fn data(rows: &[Vec<Panel>]) -> String {
    let mut csv = String::from("panel,kind,number,x,y,z,value\n");
    for panel in rows.iter().flatten() {
        for (kind, samples) in [
            ("point", &panel.points),
            ("outline", &panel.outline),
            ("cloud", &panel.cloud),
            ("mark", &panel.marks),
            ("path", &panel.path),
        ] {
            for (number, row) in samples.iter_rows().enumerate() {
                let axis = |k: usize| row.get(k).map_or(String::new(), f32::to_string);
                let value = panel.heat.get(number).filter(|_| kind == "point");
                let _ = writeln!(
                    csv,
                    "{},{kind},{number},{},{},{},{}",
                    field(&panel.title),
                    axis(0),
                    axis(1),
                    axis(2),
                    value.map_or(String::new(), f64::to_string)
                );
            }
        }
    }
    csv
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn<'a> = Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw<'a>(area: &Area<'a>, panel: &Panel) -> Drawn<'a> {
    let flat = |samples: &Matrix| samples.iter_rows().map(seen).collect::<Vec<_>>();
    let (points, cloud) = (flat(&panel.points), flat(&panel.cloud));
    let (marks, path) = (flat(&panel.marks), flat(&panel.path));
    let mut outline = flat(&panel.outline);
    outline.extend(outline.first().copied());
    let lines = || outline.iter().chain(&path);
    let all = || points.iter().chain(&cloud).chain(&marks).chain(lines());
    let (left, right) = range(all().map(|p| p.0));
    let (low, high) = range(all().map(|p| p.1));
    // Equal scales on both axes: a fold or a stretch must look like one.
    let half = 0.5 * (right - left).max(high - low);
    let (x, y) = (0.5 * (left + right), 0.5 * (low + high));
    let mut context = ChartBuilder::on(area)
        .caption(&panel.title, ("sans-serif", 14))
        .margin(6)
        .margin_bottom(if panel.note.is_empty() { 6 } else { 22 })
        .build_cartesian_2d(x - half..x + half, y - half..y + half)?;
    let grey = BLACK.mix(0.25);
    context.draw_series(cloud.iter().map(|&p| Circle::new(p, 1, grey.filled())))?;
    context.draw_series(LineSeries::new(outline, BLACK.mix(0.45).stroke_width(1)))?;
    for [from, to] in edges(&panel.grid) {
        let colour = match (panel.heat.get(from), panel.heat.get(to)) {
            (Some(a), Some(b)) => heat(0.5 * (a + b)),
            _ => RGBColor(40, 80, 140),
        };
        let line = PathElement::new(vec![points[from], points[to]], colour.stroke_width(1));
        context.draw_series(core::iter::once(line))?;
    }
    if panel.grid.is_empty() {
        let dots = points.iter().enumerate().map(|(i, &p)| {
            let colour = panel
                .heat
                .get(i)
                .map_or(RGBColor(40, 80, 140), |&v| heat(v));
            Circle::new(p, 2, colour.filled())
        });
        context.draw_series(dots)?;
    }
    context.draw_series(LineSeries::new(path, BLACK.stroke_width(2)))?;
    let red = RGBColor(200, 20, 20);
    context.draw_series(marks.iter().map(|&p| Circle::new(p, 4, red.filled())))?;
    context.draw_series(marks.iter().enumerate().map(|(i, &p)| {
        let style = ("sans-serif", 16).into_font().color(&red);
        EmptyElement::at(p) + Text::new((i + 1).to_string(), (6, -14), style)
    }))?;
    if panel.note.is_empty() {
        return Ok(());
    }
    let left = if panel.heat.is_empty() {
        12
    } else {
        scale(area)?
    };
    let style = ("sans-serif", 12).into_font().color(&BLACK);
    let place = (left, SIZE.1 as i32 - 18);
    area.draw(&Text::new(panel.note.clone(), place, style))
}

/// The colours from first to last; where they end.
fn scale<'a>(
    area: &Area<'a>,
) -> Result<i32, DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    const STEPS: i32 = 40;
    let (left, low) = (12, SIZE.1 as i32 - 16);
    for step in 0..STEPS {
        let colour = heat(f64::from(step) / f64::from(STEPS - 1));
        let corners = [(left + 2 * step, low), (left + 2 * step + 2, low + 9)];
        area.draw(&Rectangle::new(corners, colour.filled()))?;
    }
    Ok(left + 2 * STEPS + 8)
}

/// Neighbours on the grid, as indices of points.
fn edges(grid: &[[usize; 2]]) -> Vec<[usize; 2]> {
    let places: std::collections::BTreeMap<[usize; 2], usize> =
        grid.iter().enumerate().map(|(i, &g)| (g, i)).collect();
    let mut edges = Vec::new();
    for (from, &[column, row]) in grid.iter().enumerate() {
        for next in [[column + 1, row], [column, row + 1]] {
            edges.extend(places.get(&next).map(|&to| [from, to]));
        }
    }
    edges
}

/// Where a point is seen: two columns as they are; three from above, turned by 20° and raised by 50°.
fn seen(row: &[f32]) -> (f64, f64) {
    let at = |k: usize| row.get(k).copied().map_or(0.0, f64::from);
    let (x, y, z) = (at(0), at(1), at(2));
    if row.len() < 3 {
        return (x, y);
    }
    let (turn, rise) = (20.0_f64.to_radians(), 50.0_f64.to_radians());
    let across = x * libm::cos(turn) - y * libm::sin(turn);
    let away = x * libm::sin(turn) + y * libm::cos(turn);
    (across, away * libm::sin(rise) + z * libm::cos(rise))
}

/// Blue over yellow to red.
fn heat(value: f64) -> RGBColor {
    let value = value.clamp(0.0, 1.0);
    let mix = |a: f64, b: f64, part: f64| (a + (b - a) * part) as u8;
    if value < 0.5 {
        let part = 2.0 * value;
        RGBColor(
            mix(40.0, 240.0, part),
            mix(80.0, 190.0, part),
            mix(160.0, 50.0, part),
        )
    } else {
        let part = 2.0 * value - 1.0;
        RGBColor(
            mix(240.0, 190.0, part),
            mix(190.0, 10.0, part),
            mix(50.0, 20.0, part),
        )
    }
}
