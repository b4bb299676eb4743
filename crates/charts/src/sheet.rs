//! What all drawings share: a white sheet divided into rows and columns of one size, text, keys.

use super::Error;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Of all small text.
pub(super) const FONT: &str = "sans-serif";
/// Of everything that is said in passing.
pub(super) const GREY: RGBColor = RGBColor(90, 90, 90);
/// Height of a line of a key, pixels.
pub(super) const KEY_LINE: u32 = 20;

/// Sizes of a sheet, pixels.
#[derive(Clone, Copy)]
pub(super) struct Sheet {
    /// Width and height of one drawing.
    pub size: (u32, u32),
    /// Room beside the drawings.
    pub right: u32,
    /// Room below them.
    pub below: u32,
}

impl Sheet {
    /// Draws rows of items, each into a field of its own, then what stands beside and below; returns the SVG.
    pub(super) fn draw<T>(
        self,
        rows: &[Vec<T>],
        each: impl for<'a> Fn(&Area<'a>, &T) -> Drawn,
        margins: impl for<'a> Fn(&Area<'a>, &Area<'a>) -> Drawn,
    ) -> Result<String, Error> {
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let count = rows.len().max(1);
        let (width, height) = (self.size.0 * columns as u32, self.size.1 * count as u32);
        let mut svg = String::new();
        {
            let size = (width + self.right, height + self.below);
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            let drawn = || -> Drawn {
                root.fill(&WHITE)?;
                let (above, below) = root.split_vertically(height);
                let (fields, beside) = above.split_horizontally(width);
                let fields = fields.split_evenly((count, columns));
                for (row, fields) in rows.iter().zip(fields.chunks(columns)) {
                    for (item, field) in row.iter().zip(fields) {
                        each(field, item)?;
                    }
                }
                margins(&beside, &below)?;
                root.present()
            };
            drawn().map_err(|error| Error(error.to_string()))?;
        }
        Ok(svg)
    }
}

/// Text that begins at a place, its middle at that height.
pub(super) fn text(area: &Area<'_>, words: &str, at: (i32, i32), size: u32) -> Drawn {
    let left = Pos::new(HPos::Left, VPos::Center);
    let style = (FONT, size).into_font().color(&BLACK).pos(left);
    area.draw(&Text::new(words.to_owned(), at, style))
}

/// Text in the middle of a field, its top at that height.
pub(super) fn centred(
    area: &Area<'_>,
    words: &str,
    top: i32,
    size: u32,
    colour: RGBColor,
) -> Drawn {
    let middle = Pos::new(HPos::Center, VPos::Top);
    let style = (FONT, size).into_font().color(&colour).pos(middle);
    let (width, _) = area.dim_in_pixel();
    area.draw(&Text::new(words.to_owned(), (width as i32 / 2, top), style))
}

/// What stands before a word of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// A dot.
    Dot,
    /// A line.
    Line,
}

/// A word of a key, beside its sign.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// What it means.
    pub text: String,
    /// Of the sign: red, green, blue.
    pub colour: [u8; 3],
    /// The sign.
    pub sign: Sign,
}

impl Key {
    /// A word beside a line.
    #[must_use]
    pub fn line(text: impl Into<String>, colour: [u8; 3]) -> Self {
        Self {
            text: text.into(),
            colour,
            sign: Sign::Line,
        }
    }

    /// A word beside a dot.
    #[must_use]
    pub fn dot(text: impl Into<String>, colour: [u8; 3]) -> Self {
        Self {
            sign: Sign::Dot,
            ..Self::line(text, colour)
        }
    }

    pub(super) fn draw(&self, area: &Area<'_>, (x, y): (i32, i32), size: u32) -> Drawn {
        let colour = rgb(self.colour);
        match self.sign {
            Sign::Line => {
                area.draw(&PathElement::new(
                    [(x, y), (x + 22, y)],
                    colour.stroke_width(3),
                ))?;
            }
            Sign::Dot => area.draw(&Circle::new((x + 11, y), 4, colour.filled()))?,
        }
        text(area, &self.text, (x + 29, y), size)
    }
}

pub(super) const fn rgb([red, green, blue]: [u8; 3]) -> RGBColor {
    RGBColor(red, green, blue)
}
