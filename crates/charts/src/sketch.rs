//! Line drawings that others make (of hands and grippers, say), laid out in rows with a title each.

use super::sheet::{Area, Drawn, GREY, Key, Sheet, centred, rgb};
use super::{Drawing, Error};
use plotters::prelude::*;

/// A line or a filled outline.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// Points, x to the right and y up, each from 0 to 1 over the drawing, which is [`Sketch::ASPECT`] as high as wide.
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

impl Sketch {
    /// Height over width of the drawing without title and note.
    pub const ASPECT: f32 = (SIZE.1 - TITLE - NOTE) as f32 / (SIZE.0 - 2 * MARGIN) as f32;
}

/// Size of one drawing with its title, pixels, its margins, and the heights of title and note.
const SIZE: (u32, u32) = (170, 204);
const MARGIN: u32 = 6;
const TITLE: u32 = 24;
const NOTE: u32 = 22;
/// Room for one word of the key.
const WORD: i32 = 200;

/// Draws rows of sketches and, below, what their colours mean. Their data is `csv`.
///
/// # Errors
/// [`Error`].
pub fn sketches(rows: &[Vec<Sketch>], key: &[Key], csv: String) -> Result<Drawing, Error> {
    let sheet = Sheet {
        size: SIZE,
        right: 0,
        below: if key.is_empty() { 0 } else { 34 },
    };
    let svg = sheet.draw(rows, draw, |_, below| {
        for (place, word) in key.iter().enumerate() {
            word.draw(below, (16 + WORD * place as i32, 15), 13)?;
        }
        Ok(())
    })?;
    Ok(Drawing { svg, csv })
}

fn draw(area: &Area<'_>, sketch: &Sketch) -> Drawn {
    centred(area, &sketch.title, 6, 14, BLACK)?;
    centred(area, &sketch.note, (SIZE.1 - NOTE) as i32 + 3, 12, GREY)?;
    let across = f64::from(SIZE.0 - 2 * MARGIN);
    let tall = f64::from(SIZE.1 - TITLE - NOTE);
    let place = |&(x, y): &(f64, f64)| {
        (
            libm::round(f64::from(MARGIN) + x * across) as i32,
            libm::round(f64::from(TITLE) + (1.0 - y) * tall) as i32,
        )
    };
    for stroke in &sketch.strokes {
        let colour = rgb(stroke.colour);
        let points: Vec<(i32, i32)> = stroke.points.iter().map(place).collect();
        if stroke.width == 0 {
            area.draw(&Polygon::new(points, colour.filled()))?;
            continue;
        }
        // Round ends and joints.
        for &point in &points {
            area.draw(&Circle::new(point, stroke.width / 2, colour.filled()))?;
        }
        area.draw(&PathElement::new(points, colour.stroke_width(stroke.width)))?;
    }
    Ok(())
}
