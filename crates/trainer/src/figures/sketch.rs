//! Line drawings that others make (of hands and grippers, say), laid out in rows with a title each.

use super::{Error, write};
use plotters::prelude::*;
use std::path::Path;

/// A line or a filled outline.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// Points, x to the right and y up, each from 0 to 1 over the drawing.
    pub points: Vec<(f64, f64)>,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// Width of the line, pixels; 0: the outline is filled.
    pub width: u32,
}

/// One drawing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sketch {
    /// Above the drawing.
    pub title: String,
    /// Below the drawing.
    pub note: String,
    /// Drawn one after another, later ones over earlier ones.
    pub strokes: Vec<Stroke>,
}

/// Size of one drawing with its title, pixels, and the heights of title and note.
const SIZE: (u32, u32) = (170, 210);
const TITLE: u32 = 22;
const NOTE: u32 = 20;

/// Draws rows of sketches into `path` (SVG), `csv` beside it.
///
/// # Errors
/// [`Error`].
pub fn sketches(path: &Path, rows: &[Vec<Sketch>], csv: &str) -> Result<(), Error> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let count = rows.len().max(1);
    let size = (SIZE.0 * columns as u32, SIZE.1 * count as u32);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(|e| Error::draw(path, &e))?;
        let areas = root.split_evenly((count, columns));
        for (row, areas) in rows.iter().zip(areas.chunks(columns)) {
            for (sketch, area) in row.iter().zip(areas) {
                draw(area, sketch).map_err(|e| Error::draw(path, &e))?;
            }
        }
        root.present().map_err(|e| Error::draw(path, &e))?;
    }
    write(path, &svg, csv)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn<'a> = Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw<'a>(area: &Area<'a>, sketch: &Sketch) -> Drawn<'a> {
    let middle = plotters::style::text_anchor::Pos::new(
        plotters::style::text_anchor::HPos::Center,
        plotters::style::text_anchor::VPos::Top,
    );
    let text =
        |size: u32, colour: RGBColor| ("sans-serif", size).into_font().color(&colour).pos(middle);
    let (width, height) = (SIZE.0 as i32, SIZE.1 as i32);
    area.draw(&Text::new(
        sketch.title.clone(),
        (width / 2, 5),
        text(14, BLACK),
    ))?;
    let grey = RGBColor(90, 90, 90);
    let below = (width / 2, height - NOTE as i32 + 2);
    area.draw(&Text::new(sketch.note.clone(), below, text(11, grey)))?;
    let (margin, top) = (6.0, f64::from(TITLE));
    let tall = f64::from(SIZE.1 - TITLE - NOTE);
    let across = f64::from(SIZE.0) - 2.0 * margin;
    let place = |&(x, y): &(f64, f64)| {
        (
            libm::round(margin + x * across) as i32,
            libm::round(top + (1.0 - y) * tall) as i32,
        )
    };
    for stroke in &sketch.strokes {
        let [red, green, blue] = stroke.colour;
        let colour = RGBColor(red, green, blue);
        let points: Vec<(i32, i32)> = stroke.points.iter().map(place).collect();
        if stroke.width == 0 {
            area.draw(&Polygon::new(points, colour.filled()))?;
        } else {
            area.draw(&PathElement::new(points, colour.stroke_width(stroke.width)))?;
        }
    }
    Ok(())
}
