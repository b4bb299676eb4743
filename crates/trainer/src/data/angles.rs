//! Columns of joint angles: radians or degrees, within a full turn, brought to ±π.

use super::error::Error;
use super::matrix::Matrix;
use super::names::Unit;
use super::table::Table;
use core::f64::consts::{PI, TAU};

/// From here on a file without a word about its unit may be in degrees. Radians do not get there: five turns.
const SURELY_DEGREES: f64 = 30.0;

/// Columns of joint angles, radians, each in ±π.
pub(super) fn read(table: &mut Table, names: &[&str]) -> Result<Matrix, Error> {
    let places = table.positions(names)?;
    let mut values: Vec<Vec<f64>> = Vec::with_capacity(table.rows.len());
    for row in 0..table.rows.len() {
        let numbers = places.iter().map(|&place| table.number(row, place));
        values.push(numbers.collect::<Result<_, _>>()?);
    }
    let degrees = is_in_degrees(table, &places, &values)?;
    let turn = if degrees { 360.0 } else { TAU };
    let mut wrapped: Option<(usize, usize)> = None;
    let mut count = 0;
    let mut angles = Matrix {
        rows: values.len(),
        cols: places.len(),
        data: Vec::with_capacity(values.len() * places.len()),
    };
    for (row, numbers) in values.iter().enumerate() {
        for (column, &written) in numbers.iter().enumerate() {
            // As wide as a full turn in the file's own precision.
            if (written as f32).abs() > turn as f32 {
                return Err(Error::BeyondTurn {
                    at: table.field(row, places[column]),
                    degrees,
                });
            }
            let mut angle = if degrees {
                written.to_radians()
            } else {
                written
            };
            if angle.abs() > PI {
                wrapped.get_or_insert((row, column));
                count += 1;
                angle -= TAU.copysign(angle);
            }
            angles.data.push(angle as f32);
        }
    }
    if let Some((row, column)) = wrapped {
        table.note(format!(
            "line {} (row {}), column `{}`: {} is more than half a turn: {count} such angles are taken modulo a full turn (2π), as ±π",
            table.rows[row].0,
            row + 1,
            names[column],
            values[row][column],
        ));
    }
    Ok(angles)
}

/// Whether the angles are in degrees: as the header says, else as only degrees can be.
fn is_in_degrees(table: &mut Table, places: &[usize], values: &[Vec<f64>]) -> Result<bool, Error> {
    let unit = |place: &usize| table.header[*place].unit.clone();
    let unknown = places.iter().find_map(|place| match unit(place) {
        Some(Unit::Other(word)) => Some((*place, word)),
        Some(Unit::Time(_)) => Some((*place, "a time".to_owned())),
        _ => None,
    });
    if let Some((place, word)) = unknown {
        return Err(Error::Unit {
            file: table.file.clone(),
            column: table.header[place].written.clone(),
            unit: word,
        });
    }
    let said: Vec<Option<bool>> = places
        .iter()
        .map(|place| unit(place).map(|unit| unit == Unit::Degrees))
        .collect();
    if let Some(first) = said.iter().flatten().next().copied() {
        if let Some(other) = said.iter().position(|s| *s != Some(first)) {
            return Err(Error::MixedUnits {
                file: table.file.clone(),
                column: table.header[places[other]].written.clone(),
                others: if first { "degrees" } else { "radians" },
            });
        }
        if first {
            table.note("angles are in degrees, as the header says".to_owned());
        }
        return Ok(first);
    }
    let largest = |column: usize| {
        let column = values.iter().map(|row| row[column].abs());
        column.fold(0.0, f64::max)
    };
    let largest: Vec<f64> = (0..places.len()).map(largest).collect();
    let beyond = largest.iter().filter(|value| **value > TAU).count();
    let most = largest.iter().copied().fold(0.0, f64::max);
    let degrees = beyond * 2 > places.len() && (SURELY_DEGREES..=360.0).contains(&most);
    if degrees {
        table.note(format!(
            "angles up to {most:.1} can only be degrees: taken as such (the header may say [deg])"
        ));
    }
    Ok(degrees)
}
