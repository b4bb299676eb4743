//! The fuzz target as a plain function: any bytes in, a panic only when something is wrong. Run by `tests/fuzz.rs` on
//! stable; a coverage-guided fuzzer calls the same function.

use std::path::Path;
use trainer::data::{Columns, Error, Matrix, Pairs, Poses, Table};

const INPUTS: [&str; 2] = ["thumb_flex", "index_flex"];
const TARGETS: [&str; 1] = ["finger_a"];

/// The first byte says what is looked for, the rest is the file. What is read is whole and finite, angles are within half a
/// turn, times grow; what is refused is said with the file's name. Whether it was read.
pub fn table(data: &[u8]) -> bool {
    let (kind, file) = data.split_first().unwrap_or((&0, &[]));
    let outcome = match kind % 4 {
        0 => poses(file),
        1 => pairs(file),
        2 => samples(file, &["q"]),
        _ => samples(file, &["q", "x"]),
    };
    match outcome {
        Ok(()) => true,
        Err(error) => {
            let said = error.to_string();
            assert!(said.contains("any.csv"), "{said}");
            false
        }
    }
}

fn open(file: &[u8], columns: Columns<'_>) -> Result<Table, Error> {
    Table::read(file, Path::new("any.csv"), columns)
}

fn poses(file: &[u8]) -> Result<(), Error> {
    let mut table = open(file, Columns::Named(&INPUTS))?;
    let Poses { time_s, rows } = table.poses(&INPUTS)?;
    whole(&rows, INPUTS.len());
    let half = core::f32::consts::PI;
    assert!(
        rows.data.iter().all(|angle| angle.abs() <= half),
        "{rows:?}"
    );
    if let Some(times) = time_s {
        assert_eq!(times.len(), rows.rows);
        assert!(times.iter().all(|time| time.is_finite()), "{times:?}");
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
    }
    assert!(table.notes().iter().all(|note| !note.is_empty()));
    Ok(())
}

fn pairs(file: &[u8]) -> Result<(), Error> {
    let names = [&INPUTS[..], &TARGETS].concat();
    let mut table = open(file, Columns::Named(&names))?;
    let Pairs { inputs, targets } = table.hand_pairs(&INPUTS, &TARGETS)?;
    whole(&inputs, INPUTS.len());
    whole(&targets, TARGETS.len());
    assert_eq!(inputs.rows, targets.rows);
    Ok(())
}

fn samples(file: &[u8], prefixes: &[&str]) -> Result<(), Error> {
    let mut table = open(file, Columns::Numbered(prefixes))?;
    for prefix in prefixes {
        let samples = table.samples(prefix)?;
        whole(&samples, samples.cols);
    }
    Ok(())
}

fn whole(samples: &Matrix, cols: usize) {
    assert!(samples.rows >= 1 && samples.cols >= 1 && samples.cols == cols);
    assert_eq!(samples.data.len(), samples.rows * samples.cols);
    assert!(samples.data.iter().all(|value| value.is_finite()));
}
