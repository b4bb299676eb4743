//! The time of a recording: seconds, milliseconds or numbers of frames; anew with each clip; the same frame twice.

use super::error::Error;
use super::matrix::Matrix;
use super::names::Unit;
use super::samples::Poses;
use super::table::Table;

/// Frames a second where only their numbers are known.
const FRAMES_HZ: f64 = 30.0;
/// Between the end of a clip and the next one: in less a hand does not get from one pose to any other.
const BETWEEN_CLIPS_S: f64 = 1.0;
/// Fewest rows from which the unit of a time is judged, and of a clip that no column tells.
const ENOUGH: usize = 10;
/// Other names of the time.
const TIMES: [&str; 5] = ["time", "t", "timestamp", "time_stamp", "elapsed"];
const FRAMES: [&str; 5] = [
    "frame",
    "frame_number",
    "frame_no",
    "frame_id",
    "frame_index",
];

/// What a column of times counts.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Count {
    /// Seconds, each so long.
    Seconds(f64),
    /// Frames.
    Frames,
}

/// The poses with the time of each, strictly growing, where the table has a column of it. Doubled frames are left out.
pub(super) fn read(table: &mut Table, rows: Matrix) -> Result<Poses, Error> {
    let Some((place, said)) = column(table)? else {
        return Ok(Poses { time_s: None, rows });
    };
    let is_exact = table.header[place].written == "time_s";
    let mut notes = Vec::new();
    match times(table, place, said, &rows, &mut notes) {
        Ok(poses) => {
            notes.into_iter().for_each(|note| table.note(note));
            Ok(poses)
        }
        Err(error) if is_exact => Err(error),
        // Until now nobody asked for it.
        Err(_) => {
            let name = table.header[place].written.clone();
            table.note(format!(
                "column `{name}` is no time that grows: passed over"
            ));
            Ok(Poses { time_s: None, rows })
        }
    }
}

/// Where the time stands, and what its name says of its unit.
fn column(table: &Table) -> Result<Option<(usize, Option<Count>)>, Error> {
    if let Some(place) = table.position("time_s")? {
        return Ok(Some((place, None)));
    }
    let find = |names: &[&str]| {
        let is = |name: &super::names::Name| names.contains(&name.plain.as_str());
        table.header.iter().position(is)
    };
    if let Some(place) = find(&TIMES) {
        let said = match table.header[place].unit {
            Some(Unit::Time(seconds)) => Some(Count::Seconds(seconds)),
            _ => None,
        };
        return Ok(Some((place, said)));
    }
    Ok(find(&FRAMES).map(|place| (place, Some(Count::Frames))))
}

fn times(
    table: &Table,
    place: usize,
    said: Option<Count>,
    rows: &Matrix,
    notes: &mut Vec<String>,
) -> Result<Poses, Error> {
    let numbers = (0..table.rows.len()).map(|row| table.number(row, place));
    let written = numbers.collect::<Result<Vec<f64>, _>>()?;
    let step = median_step(&written);
    let count = said.or_else(|| judged(&written, step));
    let name = table.header[place].written.clone();
    match count {
        Some(Count::Frames) => notes.push(format!(
            "column `{name}` counts frames: taken as {FRAMES_HZ} a second"
        )),
        Some(Count::Seconds(unit)) if unit != 1.0 => notes.push(format!(
            "column `{name}` is in {}",
            match unit {
                1e-3 => "milliseconds",
                1e-6 => "microseconds",
                _ => "nanoseconds",
            }
        )),
        _ => {}
    }
    let seconds = |number: f64| match count {
        Some(Count::Frames) => number / FRAMES_HZ,
        Some(Count::Seconds(unit)) if unit != 1.0 => number * unit,
        _ => number,
    };
    let (kept, starts) = order(table, place, &written, step, rows)?;
    let mut time_s: Vec<f64> = Vec::with_capacity(kept.len());
    let mut offset = 0.0;
    for &row in &kept {
        let time = seconds(written[row]);
        if starts.binary_search(&row).is_ok() {
            let end = time_s.last().copied().unwrap_or(0.0);
            offset = end + BETWEEN_CLIPS_S - time;
        }
        time_s.push(time + offset);
    }
    if kept.len() < table.rows.len() {
        let count = table.rows.len() - kept.len();
        notes.push(format!(
            "{count} rows repeat the frame before them: passed over"
        ));
    }
    if !starts.is_empty() {
        notes.push(format!(
            "the time starts anew {} times: as many new clips, {BETWEEN_CLIPS_S} s after one another",
            starts.len()
        ));
    }
    Ok(Poses {
        time_s: Some(time_s),
        rows: rows.select(&kept),
    })
}

/// The step that most rows make, forward.
fn median_step(written: &[f64]) -> f64 {
    let steps = written.windows(2).map(|pair| pair[1] - pair[0]);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// What times of such a step count: hands are recorded at 5 to 1,000 frames a second.
fn judged(written: &[f64], step: f64) -> Option<Count> {
    if written.len() < ENOUGH {
        return None;
    }
    let whole = written.iter().all(|number| number.fract() == 0.0);
    match step {
        1.0 if whole => Some(Count::Frames),
        step if step < 0.95 => Some(Count::Seconds(1.0)),
        step if step < 1e3 => Some(Count::Seconds(1e-3)),
        step if step < 1e6 => Some(Count::Seconds(1e-6)),
        _ => Some(Count::Seconds(1e-9)),
    }
}

/// The rows that are frames of their own, and those with which a new clip begins, its time from anew.
fn order(
    table: &Table,
    place: usize,
    written: &[f64],
    step: f64,
    rows: &Matrix,
) -> Result<(Vec<usize>, Vec<usize>), Error> {
    let clip = table.position("clip")?;
    let clip_of = |row: usize| clip.and_then(|clip| table.rows[row].1.get(clip));
    let (mut kept, mut starts): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
    // Beginnings that no column tells, with the clip they end.
    let mut untold: Vec<usize> = Vec::new();
    for row in 0..written.len() {
        let Some(&before) = kept.last() else {
            kept.push(row);
            continue;
        };
        let told = clip_of(row) != clip_of(before) || table.joints.binary_search(&row).is_ok();
        if written[row] <= written[before] {
            if told {
                starts.push(row);
            } else if written[row] == written[before] && rows.row(row) == rows.row(before) {
                continue;
            } else if is_new_clip(written, before, row, step) {
                untold.push(row);
                starts.push(row);
            } else {
                return Err(refusal(table, place, written, before, row));
            }
        }
        kept.push(row);
    }
    // A few rows between two steps back are rows out of order, not clips.
    for &row in &untold {
        let at = starts.binary_search(&row).unwrap_or(0);
        let from = if at == 0 { 0 } else { starts[at - 1] };
        let to = starts.get(at + 1).copied().unwrap_or(written.len());
        if row - from < ENOUGH || to - row < ENOUGH {
            return Err(refusal(table, place, written, row - 1, row));
        }
    }
    Ok((kept, starts))
}

/// Whether a clip may begin at a row whose time lies before that of the row `before`: far back, and not by this row alone.
fn is_new_clip(written: &[f64], before: usize, row: usize, step: f64) -> bool {
    const BACK: f64 = 5.0;
    const FOLLOWING: usize = 4;
    let following = written.iter().skip(row + 1).take(FOLLOWING);
    step > 0.0
        && written[before] - written[row] >= BACK * step
        && following.into_iter().all(|time| *time < written[before])
}

fn refusal(table: &Table, place: usize, written: &[f64], before: usize, row: usize) -> Error {
    Error::TimeNotIncreasing {
        at: table.field(row, place),
        before: written[before],
    }
}
