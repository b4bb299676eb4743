//! A recorded calibration session: a folder with `raw.csv`, the sensors' bytes scan by scan, and `prompts.csv`, what the person was
//! asked to do when.
//!
//! `raw.csv`: `time_s`, then `s00` to `s15`: eight bytes in hex as registers 20 to 27 gave them, empty where none came. A row is a
//! scan; its time is the scan's beginning, and sensor k was read k · 1.8 ms later. `prompts.csv`: `name,start_s,end_s`.

use std::path::{Path, PathBuf};

use glove::calibration::{Finger, Step};
use glove::hand::SEGMENT_COUNT;
use glove::imu::SAMPLE_BYTES;

use crate::failure::{Failure, OrFail};

/// From one sensor's read to the next in a scan, microseconds.
const SKEW_US: u64 = 1_800;

/// No recording is longer: a day.
const LONGEST_S: f64 = 86_400.0;

/// One scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The time as the file has it.
    pub time: String,
    /// Its beginning.
    pub at: glove::Instant,
    /// Each sensor's bytes.
    pub reads: [Option<[u8; SAMPLE_BYTES]>; SEGMENT_COUNT],
}

impl Row {
    /// When sensor `k` was read.
    pub fn stamp(&self, k: usize) -> glove::Instant {
        glove::Instant::from_ticks(self.at.as_ticks() + SKEW_US * k as u64)
    }
}

/// What a stretch of the recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prompt {
    /// A step of the calibration.
    Calibration(Step),
    /// The hand is used.
    Use,
    /// The person was asked for a flat pose while the hand was in use.
    FlatInUse,
    /// A name that means nothing here.
    Other,
}

impl Prompt {
    fn named(name: &str) -> Self {
        Self::Calibration(match name {
            "flat1" => Step::FirstFlat,
            "turn" => Step::Turn,
            "flat2" => Step::SecondFlat,
            "one0" => Step::Alone(Finger::Index),
            "one1" => Step::Alone(Finger::Middle),
            "one2" => Step::Alone(Finger::Ring),
            "one3" => Step::Alone(Finger::Little),
            "one4" => Step::Alone(Finger::Thumb),
            "fist" => Step::Fists,
            "thumb" => Step::Thumb,
            "free" => Step::Free,
            "flat3" => Step::LastFlat,
            "use" => return Self::Use,
            name if name.starts_with("flat_use") => return Self::FlatInUse,
            _ => return Self::Other,
        })
    }
}

/// A stretch of the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// As the file has it.
    pub name: String,
    /// What it is.
    pub prompt: Prompt,
    /// From here …
    pub start: glove::Instant,
    /// … to here.
    pub end: glove::Instant,
}

impl Window {
    /// Whether `at` lies within it.
    pub fn holds(&self, at: glove::Instant) -> bool {
        self.start <= at && at <= self.end
    }
}

/// A recorded session.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// Scans, in the order of time.
    pub rows: Vec<Row>,
    /// What the person was asked to do, in the order of time.
    pub windows: Vec<Window>,
}

impl Recorded {
    /// Reads a folder.
    ///
    /// # Errors
    /// A file that cannot be read or has another form; the file, the line and the value are named.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let mut windows = lines(
            &folder.join("prompts.csv"),
            &["name", "start_s", "end_s"],
            window,
        )?;
        windows.sort_by_key(|window| window.start);
        let names: Vec<String> = (0..SEGMENT_COUNT).map(|k| format!("s{k:02}")).collect();
        let header: Vec<&str> = std::iter::once("time_s")
            .chain(names.iter().map(String::as_str))
            .collect();
        let path = folder.join("raw.csv");
        let rows = lines(&path, &header, row)?;
        if let Some(pair) = rows.windows(2).find(|pair| pair[0].at >= pair[1].at) {
            return Err(Failure::new(
                format!(
                    "{}: the time goes from {} to {}",
                    path.display(),
                    pair[0].time,
                    pair[1].time
                ),
                "rows in the order of time, each time once",
            )
            .into());
        }
        Ok(Self { rows, windows })
    }
}

/// The lines of a CSV file with this header.
fn lines<T>(
    path: &PathBuf,
    header: &[&str],
    parse: impl Fn(&[&str]) -> Result<T, String>,
) -> anyhow::Result<Vec<T>> {
    let shown = path.display();
    let text = std::fs::read_to_string(path).or_fail(
        || format!("{shown}"),
        "a folder with raw.csv and prompts.csv",
    )?;
    let expected = format!("the header {}", header.join(","));
    let mut lines = text.lines().enumerate();
    let first = lines.next().map_or("", |(_, line)| line.trim());
    let found: Vec<&str> = first
        .trim_start_matches('\u{feff}')
        .split(',')
        .map(str::trim)
        .collect();
    if found != header {
        let what = format!("{shown}: line 1 is `{first:.60}`");
        return Err(Failure::new(what, expected).into());
    }
    let mut values = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let value = if cells.len() == header.len() {
            parse(&cells)
        } else {
            Err(format!("{} fields, not {}", cells.len(), header.len()))
        };
        values.push(value.or_fail(
            || format!("{shown}: line {}", number + 1),
            "mend that line, or leave it out",
        )?);
    }
    if values.is_empty() {
        return Err(Failure::new(format!("{shown}: no lines after the header"), expected).into());
    }
    Ok(values)
}

fn window(cells: &[&str]) -> Result<Window, String> {
    let [name, start, end] = cells else {
        return Err("not three fields".to_owned());
    };
    let (from, to) = (time(start)?, time(end)?);
    if from >= to {
        return Err(format!(
            "`{name}` ends at {end}, before it begins at {start}"
        ));
    }
    Ok(Window {
        name: (*name).to_owned(),
        prompt: Prompt::named(name),
        start: from,
        end: to,
    })
}

fn row(cells: &[&str]) -> Result<Row, String> {
    let (text, sensors) = cells.split_first().ok_or("empty")?;
    let mut reads = [None; SEGMENT_COUNT];
    for (read, cell) in reads.iter_mut().zip(sensors) {
        *read = bytes(cell)?;
    }
    Ok(Row {
        time: (*text).to_owned(),
        at: time(text)?,
        reads,
    })
}

fn time(text: &str) -> Result<glove::Instant, String> {
    let seconds: f64 = text
        .parse()
        .map_err(|_| format!("`{text:.40}` is no time in seconds"))?;
    if !(0.0..=LONGEST_S).contains(&seconds) {
        return Err(format!("the time {text:.40} s is outside 0 to {LONGEST_S}"));
    }
    Ok(glove::Instant::from_ticks((seconds * 1e6).round() as u64))
}

fn bytes(cell: &str) -> Result<Option<[u8; SAMPLE_BYTES]>, String> {
    if cell.is_empty() {
        return Ok(None);
    }
    let wrong = || format!("`{cell:.40}` is not eight bytes in hex");
    if cell.len() != 2 * SAMPLE_BYTES || !cell.is_ascii() {
        return Err(wrong());
    }
    let number = u64::from_str_radix(cell, 16).map_err(|_| wrong())?;
    Ok(Some(number.to_be_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(raw: &str, prompts: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("raw.csv"), raw).unwrap();
        std::fs::write(folder.path().join("prompts.csv"), prompts).unwrap();
        folder
    }

    fn header() -> String {
        let names: Vec<String> = (0..16).map(|k| format!(",s{k:02}")).collect();
        format!("time_s{}\n", names.concat())
    }

    #[test]
    fn bytes_stand_in_the_order_of_the_wire_and_an_empty_cell_is_no_read() {
        let cells = ",".repeat(14);
        let raw = format!("{}0.0500,540ec2c6e8f560e9,{cells}\n", header());
        let folder = folder(&raw, "name,start_s,end_s\nflat1,1.0,3.0\n");
        let recorded = Recorded::read(folder.path()).unwrap();
        let row = &recorded.rows[0];
        assert_eq!(row.at.as_ticks(), 50_000);
        assert_eq!(row.stamp(15).as_ticks(), 77_000);
        assert_eq!(
            row.reads[0],
            Some([0x54, 0x0e, 0xc2, 0xc6, 0xe8, 0xf5, 0x60, 0xe9])
        );
        assert_eq!(row.reads[1], None);
        let flat = &recorded.windows[0];
        assert_eq!(flat.prompt, Prompt::Calibration(Step::FirstFlat));
    }

    #[test]
    fn a_bad_line_is_named_with_its_file_number_and_value() {
        let cells = ",".repeat(14);
        let prompts = "name,start_s,end_s\nflat1,1.0,3.0\n";
        for (raw, told) in [
            (format!("{}0.05,54,{cells}\n", header()), "line 2: `54`"),
            (format!("{}x,,{cells}\n", header()), "line 2: `x`"),
            (format!("{}0.05,,\n", header()), "3 fields, not 17"),
            (
                format!("{}0.05,,{cells}\n0.05,,{cells}\n", header()),
                "0.05 to 0.05",
            ),
            ("time\n".to_owned(), "line 1 is `time`"),
            (header(), "no lines"),
        ] {
            let error = Recorded::read(folder(&raw, prompts).path()).unwrap_err();
            assert!(error.to_string().contains(told), "{error}");
            assert!(error.to_string().contains("raw.csv"), "{error}");
        }
    }
}
