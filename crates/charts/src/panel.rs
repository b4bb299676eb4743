//! Grids, clouds and marks in the plane or in space: shapes, the image of a map, its folds.

use super::sheet::{Area, Drawn, FONT, GREY, KEY_LINE, Key, Sheet, centred, rgb, text};
use super::{Drawing, Error, Points, field, range};
use core::fmt::Write as _;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Colours of what a panel shows.
pub const POINTS: [u8; 3] = [40, 80, 140];
/// See [`POINTS`].
pub const CLOUD: [u8; 3] = [190, 190, 190];
/// See [`POINTS`].
pub const MARKS: [u8; 3] = [200, 20, 20];
/// See [`POINTS`].
pub const PATH: [u8; 3] = [20, 20, 20];

/// Points that are neighbours on a grid.
#[derive(Clone, Debug, Default)]
pub struct Net {
    /// The points.
    pub points: Points,
    /// Column and row of each of them.
    pub grid: Vec<[usize; 2]>,
}

/// From where points in space are seen: turned about the vertical and raised, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// About the vertical.
    pub turn: f64,
    /// 90: from above.
    pub rise: f64,
}

impl Default for View {
    /// From above at an angle, as surfaces with a top are seen best.
    fn default() -> Self {
        Self {
            turn: 12.0,
            rise: 62.0,
        }
    }
}

/// One drawing. Points have two or three columns; three are seen from [`Panel::view`].
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Above the drawing.
    pub title: String,
    /// Points of the grid.
    pub points: Points,
    /// Column and row of each of them: neighbours are joined by lines. Empty: dots.
    pub grid: Vec<[usize; 2]>,
    /// A value 0 to 1 a point, drawn as colour from blue to red.
    pub heat: Vec<f64>,
    /// Below the drawing; after the colours from first to last when points have values.
    pub note: String,
    /// Points of a closed line behind the grid.
    pub outline: Points,
    /// Dots behind the grid.
    pub cloud: Points,
    /// Faint lines behind the points.
    pub net: Net,
    /// Points with a number beside them, from 1 on.
    pub marks: Points,
    /// Points joined by a line, in their order.
    pub path: Points,
    /// Words beside the first and the last point of the path.
    pub path_ends: [String; 2],
    /// Points that must find room though they are not drawn: panels with the same room have the same scale.
    pub room: Points,
    /// Names of the three axes, drawn in a corner; empty: none.
    pub axes: Vec<String>,
    /// Of points in space.
    pub view: View,
    /// What is what, below the drawing.
    pub key: Vec<Key>,
}

/// Size of one panel, pixels; with a key there is more to see.
const SIZE: (u32, u32) = (300, 326);
const LARGE: (u32, u32) = (460, 500);
/// Heights of title and note.
const TITLE: u32 = 30;
const NOTE: u32 = 24;

/// Draws rows of panels; their data has the columns panel, kind, number, x, y, z, value.
///
/// # Errors
/// [`Error`].
pub fn panels(rows: &[Vec<Panel>]) -> Result<Drawing, Error> {
    let has_keys = rows.iter().flatten().any(|panel| !panel.key.is_empty());
    let sheet = Sheet {
        size: if has_keys { LARGE } else { SIZE },
        right: 0,
        below: 0,
    };
    let svg = sheet.draw(rows, draw, |_, _| Ok(()))?;
    Ok(Drawing {
        svg,
        csv: data(rows),
    })
}

fn data(rows: &[Vec<Panel>]) -> String {
    let mut csv = String::from("panel,kind,number,x,y,z,value\n");
    for panel in rows.iter().flatten() {
        for (kind, samples) in [
            ("point", &panel.points),
            ("outline", &panel.outline),
            ("cloud", &panel.cloud),
            ("net", &panel.net.points),
            ("mark", &panel.marks),
            ("path", &panel.path),
        ] {
            for (number, row) in samples.iter().enumerate() {
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

/// What a panel shows, as it is seen.
struct Seen {
    points: Vec<(f64, f64)>,
    cloud: Vec<(f64, f64)>,
    net: Vec<(f64, f64)>,
    marks: Vec<(f64, f64)>,
    path: Vec<(f64, f64)>,
    outline: Vec<(f64, f64)>,
    /// Middle, and half of the side of the square that holds everything.
    middle: (f64, f64),
    half: f64,
}

impl Seen {
    fn of(panel: &Panel) -> Self {
        let flat = |samples: &Points| -> Vec<(f64, f64)> {
            samples.iter().map(|row| panel.view.of(row)).collect()
        };
        let mut outline = flat(&panel.outline);
        outline.extend(outline.first().copied());
        let mut seen = Self {
            points: flat(&panel.points),
            cloud: flat(&panel.cloud),
            net: flat(&panel.net.points),
            marks: flat(&panel.marks),
            path: flat(&panel.path),
            outline,
            middle: (0.0, 0.0),
            half: 1.0,
        };
        let room = flat(&panel.room);
        let parts = [
            &seen.points,
            &seen.cloud,
            &seen.net,
            &seen.marks,
            &seen.path,
            &seen.outline,
            &room,
        ];
        let all = || parts.iter().flat_map(|part| part.iter());
        let (left, right) = range(all().map(|p| p.0));
        let (low, high) = range(all().map(|p| p.1));
        // Equal scales on both axes: a fold or a stretch must look like one. Numbers beside marks need room.
        let half = 0.54 * (right - left).max(high - low);
        seen.middle = (0.5 * (left + right), 0.5 * (low + high));
        seen.half = half;
        seen
    }
}

fn draw(area: &Area<'_>, panel: &Panel) -> Drawn {
    let seen = Seen::of(panel);
    let (width, height) = area.dim_in_pixel();
    centred(area, &panel.title, 8, 14, BLACK)?;
    let lines = panel.key.len().div_ceil(2) as u32;
    let note = if panel.note.is_empty() && lines == 0 {
        6
    } else {
        NOTE
    };
    let below = (note + KEY_LINE * lines) as i32;
    // The square in the middle of what is left.
    let side = (width as i32 - 12).min(height as i32 - TITLE as i32 - below);
    let (left, top) = ((width as i32 - side) / 2, TITLE as i32);
    let [horizontal, vertical] = [
        (seen.middle.0 - seen.half, seen.middle.0 + seen.half),
        (seen.middle.1 - seen.half, seen.middle.1 + seen.half),
    ];
    let square = area.clone().shrink((left, top), (side, side));
    let mut context = ChartBuilder::on(&square)
        .build_cartesian_2d(horizontal.0..horizontal.1, vertical.0..vertical.1)?;
    let (blue, red) = (rgb(POINTS), rgb(MARKS));
    let dots = |points: &[(f64, f64)], size: u32, colour: RGBColor| {
        let dots = points
            .iter()
            .map(|&p| Circle::new(p, size, colour.filled()));
        dots.collect::<Vec<_>>()
    };
    context.draw_series(dots(&seen.cloud, 1, rgb(CLOUD)))?;
    context.draw_series(edges(&panel.net.grid).into_iter().map(|[from, to]| {
        PathElement::new(
            vec![seen.net[from], seen.net[to]],
            rgb(CLOUD).stroke_width(1),
        )
    }))?;
    let grey = BLACK.mix(0.45).stroke_width(1);
    context.draw_series(LineSeries::new(seen.outline.iter().copied(), grey))?;
    context.draw_series(edges(&panel.grid).into_iter().map(|[from, to]| {
        let colour = match (panel.heat.get(from), panel.heat.get(to)) {
            (Some(a), Some(b)) => heat(0.5 * (a + b)),
            _ => blue,
        };
        PathElement::new(
            vec![seen.points[from], seen.points[to]],
            colour.stroke_width(1),
        )
    }))?;
    if panel.grid.is_empty() {
        context.draw_series(seen.points.iter().enumerate().map(|(i, &p)| {
            let colour = panel.heat.get(i).map_or(blue, |&v| heat(v));
            Circle::new(p, 2, colour.filled())
        }))?;
    }
    let line = rgb(PATH).stroke_width(2);
    context.draw_series(LineSeries::new(seen.path.iter().copied(), line))?;
    context.draw_series(dots(&seen.marks, 5, WHITE))?;
    context.draw_series(dots(&seen.marks, 4, red))?;
    for (index, &mark) in seen.marks.iter().enumerate() {
        let place = context.plotting_area().map_coordinate(&mark);
        let away = outwards(mark, seen.middle);
        number(area, &(index + 1).to_string(), place, away, red)?;
    }
    let ends = [seen.path.first(), seen.path.last()];
    for (words, end) in panel.path_ends.iter().zip(ends) {
        if let (Some(&end), false) = (end, words.is_empty()) {
            let place = context.plotting_area().map_coordinate(&end);
            let away = outwards(end, seen.middle);
            number(area, words, place, (1.4 * away.0, 1.4 * away.1), rgb(PATH))?;
        }
    }
    axes(area, panel, (left + 6, top + side - 8))?;
    foot(area, panel, height as i32 - below)
}

/// The direction away from the middle, downwards positive, of length 1.
fn outwards(point: (f64, f64), middle: (f64, f64)) -> (f64, f64) {
    let (x, y) = (point.0 - middle.0, middle.1 - point.1);
    let length = libm::hypot(x, y);
    if length > 1e-9 {
        (x / length, y / length)
    } else {
        (0.0, -1.0)
    }
}

/// A number beside its mark, with a white rim so that it is read above lines. `place` is in the pixels of the sheet.
fn number(
    area: &Area<'_>,
    words: &str,
    place: (i32, i32),
    away: (f64, f64),
    colour: RGBColor,
) -> Drawn {
    let (left, top) = area.get_base_pixel();
    let middle = Pos::new(HPos::Center, VPos::Center);
    let (width, height) = area.dim_in_pixel();
    let at = |value: i32, shift: f64, end: u32| {
        (value + libm::round(13.0 * shift) as i32).clamp(9, end as i32 - 9)
    };
    let (x, y) = (
        at(place.0 - left, away.0, width),
        at(place.1 - top, away.1, height),
    );
    for (dx, dy, shade) in [
        (-1, -1, WHITE),
        (-1, 1, WHITE),
        (1, -1, WHITE),
        (1, 1, WHITE),
        (0, 0, colour),
    ] {
        let style = (FONT, 15).into_font().color(&shade).pos(middle);
        area.draw(&Text::new(words.to_owned(), (x + dx, y + dy), style))?;
    }
    Ok(())
}

/// The three axes as they are seen, in a corner.
fn axes(area: &Area<'_>, panel: &Panel, corner: (i32, i32)) -> Drawn {
    const LENGTH: f64 = 46.0;
    let from = (corner.0 + 40, corner.1 - 22);
    for (axis, name) in panel.axes.iter().take(3).enumerate() {
        let mut unit = [0.0_f32; 3];
        unit[axis] = 1.0;
        let (x, y) = panel.view.of(&unit);
        let end = |length: f64| {
            (
                from.0 + libm::round(length * x) as i32,
                from.1 - libm::round(length * y) as i32,
            )
        };
        area.draw(&PathElement::new([from, end(LENGTH)], GREY.stroke_width(1)))?;
        let middle = Pos::new(HPos::Center, VPos::Center);
        let style = (FONT, 12).into_font().color(&GREY).pos(middle);
        area.draw(&Text::new(name.clone(), end(LENGTH + 14.0), style))?;
    }
    Ok(())
}

/// Note, colours and key.
fn foot(area: &Area<'_>, panel: &Panel, top: i32) -> Drawn {
    let (width, _) = area.dim_in_pixel();
    for (place, word) in panel.key.iter().enumerate() {
        let column = if place % 2 == 0 { 12 } else { width as i32 / 2 };
        let line = top + 10 + KEY_LINE as i32 * (place / 2) as i32;
        word.draw(area, (column, line), 13)?;
    }
    if panel.note.is_empty() {
        return Ok(());
    }
    let line = top + KEY_LINE as i32 * panel.key.len().div_ceil(2) as i32 + NOTE as i32 / 2;
    let left = if panel.heat.is_empty() {
        12
    } else {
        scale(area, line - 5)?
    };
    text(area, &panel.note, (left, line), 12)
}

/// The colours from first to last; where they end.
fn scale(area: &Area<'_>, top: i32) -> Result<i32, DrawingAreaErrorKind<std::io::Error>> {
    const STEPS: i32 = 40;
    let left = 12;
    for step in 0..STEPS {
        let colour = heat(f64::from(step) / f64::from(STEPS - 1));
        let corners = [(left + 2 * step, top), (left + 2 * step + 2, top + 10)];
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

impl View {
    /// Where a point is seen: two columns as they are, three from here.
    fn of(self, row: &[f32]) -> (f64, f64) {
        let at = |k: usize| row.get(k).copied().map_or(0.0, f64::from);
        let (x, y, z) = (at(0), at(1), at(2));
        if row.len() < 3 {
            return (x, y);
        }
        let (turn, rise) = (self.turn.to_radians(), self.rise.to_radians());
        let across = x * libm::cos(turn) - y * libm::sin(turn);
        let away = x * libm::sin(turn) + y * libm::cos(turn);
        (across, away * libm::sin(rise) + z * libm::cos(rise))
    }
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
