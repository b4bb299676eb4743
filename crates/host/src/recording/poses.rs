//! A poses file that is being written: rows of joint angles with their times, by a thread of its own.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use anyhow::Result;
use glove::hand::{JOINT_COUNT, JOINT_NAMES};

use crate::failure::{Failure, OrFail};
use crate::interrupt::Interrupt;

/// Rows that may wait for the disk: ten seconds at least.
const QUEUE: usize = 1024;
/// After so many rows the disk has them, too: a power cut costs two seconds of a usual glove.
const SYNC_EVERY: u64 = 64;

/// One pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// When, µs since any beginning; grows.
    pub at_us: u64,
    /// Joint angles, radians, in the order of [`JOINT_NAMES`].
    pub angles: [f32; JOINT_COUNT],
}

/// A poses file being written.
#[derive(Debug)]
pub struct PosesFile {
    path: PathBuf,
    /// There was something in it before.
    goes_on: bool,
    writer: JoinHandle<(u64, std::io::Result<()>)>,
}

impl PosesFile {
    /// Creates the file, never over one that is there; and where what becomes rows by `row` goes. A disk that takes no more asks for
    /// the end.
    ///
    /// # Errors
    /// A failure that names the file.
    pub fn create<T: Send + 'static>(
        path: &Path,
        interrupt: &Interrupt,
        row: impl FnMut(T) -> Option<Row> + Send + 'static,
    ) -> Result<(Self, SyncSender<T>)> {
        let name = || format!("the poses file {}", path.display());
        let file = File::create_new(path)
            .or_fail(name, "a new file's name, in a folder that you may write to")?;
        Self::write_to(file, path, interrupt, row)
    }

    /// Goes on with the file of a recording that ended, also by a power cut in a row: that one is cut off. The rows it has, and where more
    /// go.
    ///
    /// # Errors
    /// A failure that names the file, and the line that is no row.
    pub fn go_on(path: &Path, interrupt: &Interrupt) -> Result<(Vec<Row>, Self, SyncSender<Row>)> {
        let name = || format!("the poses file {}", path.display());
        let next = "a file that you may read and write";
        let text = std::fs::read(path).or_fail(name, next)?;
        let length = text
            .iter()
            .rposition(|byte| *byte == b'\n')
            .map_or(0, |end| end + 1);
        let rows = rows_of(&text[..length], path)?;
        let file = File::options().append(true).open(path);
        let file = file.or_fail(name, next)?;
        file.set_len(length as u64).or_fail(name, next)?;
        let (file, sender) = Self::write_to(file, path, interrupt, Some)?;
        Ok((rows, file, sender))
    }

    fn write_to<T: Send + 'static>(
        file: File,
        path: &Path,
        interrupt: &Interrupt,
        mut row: impl FnMut(T) -> Option<Row> + Send + 'static,
    ) -> Result<(Self, SyncSender<T>)> {
        let name = || format!("the poses file {}", path.display());
        let length = file.metadata().or_fail(name, "the same again")?.len();
        let (sender, given) = sync_channel(QUEUE);
        let interrupt = interrupt.clone();
        let writer = std::thread::Builder::new()
            .spawn(move || {
                let mut count = 0;
                let rows = given.iter().filter_map(&mut row);
                let mut whole = Whole { file, length };
                let written = write(&mut whole, rows, &mut count);
                let written = written.and_then(|()| whole.file.sync_all());
                if written.is_err() {
                    interrupt.ask();
                }
                (count, written)
            })
            .or_fail(name, "ending other programs")?;
        let poses = Self {
            path: path.to_owned(),
            goes_on: length > 0,
            writer,
        };
        Ok((poses, sender))
    }

    /// Waits for the last row; whoever gave rows has dropped the sender. Returns how many there are, and a failure that names the file
    /// where one could not be written. A file without one is taken away: it would stand in the way of the same command again.
    pub fn finish(self) -> (u64, Result<()>) {
        let stopped = || (0, Err(std::io::Error::other("its writer stopped")));
        let (count, mut written) = self.writer.join().unwrap_or_else(|_| stopped());
        if count > 0 && written.is_ok() && !self.path.exists() {
            written = Err(std::io::Error::other("another program removed it"));
        }
        if count == 0 && !self.goes_on {
            let _ = std::fs::remove_file(&self.path);
        }
        let name = || format!("the poses file {}", self.path.display());
        (count, written.or_fail(name, "room on the disk"))
    }
}

/// What can be cut back.
trait Cut: Write {
    fn cut(&mut self, length: u64) -> std::io::Result<()>;
    /// What is in it stays, also after a power cut.
    fn sync(&mut self) -> std::io::Result<()>;
}

impl Cut for File {
    fn cut(&mut self, length: u64) -> std::io::Result<()> {
        self.set_len(length)
    }

    fn sync(&mut self) -> std::io::Result<()> {
        self.sync_data()
    }
}

/// A file of whole lines, whenever somebody looks.
struct Whole<W> {
    file: W,
    length: u64,
}

impl<W: Cut> Whole<W> {
    /// Adds `line`; where there is no room for all of it, none of it stays.
    fn add(&mut self, line: &str) -> std::io::Result<()> {
        if let Err(error) = self.file.write_all(line.as_bytes()) {
            let _ = self.file.cut(self.length);
            return Err(error);
        }
        self.length += line.len() as u64;
        Ok(())
    }
}

/// A row goes to the file when it is there: whoever is killed leaves all of them.
fn write<W: Cut>(
    to: &mut Whole<W>,
    rows: impl Iterator<Item = Row>,
    count: &mut u64,
) -> std::io::Result<()> {
    if to.length == 0 {
        to.add(&header())?;
    }
    let mut line = String::new();
    for row in rows {
        line.clear();
        // A string takes all.
        let _ = write!(line, "{:.6}", row.at_us as f64 / 1e6);
        for angle in row.angles {
            let _ = write!(line, ",{angle}");
        }
        line.push('\n');
        to.add(&line)?;
        *count += 1;
        if count.is_multiple_of(SYNC_EVERY) {
            to.file.sync()?;
        }
    }
    Ok(())
}

fn header() -> String {
    format!("time_s,{}\n", JOINT_NAMES.join(","))
}

/// The rows of a file as [`write`] writes it; without a line there are none.
fn rows_of(text: &[u8], path: &Path) -> Result<Vec<Row>> {
    let wrong = |line: usize, what: &str| {
        let what = format!("{}, line {line}: {what}", path.display());
        Failure::new(what, "the poses file that a session began and did not end")
    };
    let text = std::str::from_utf8(text).map_err(|_| wrong(1, "no text"))?;
    if !text.is_empty() && !text.starts_with(&header()) {
        return Err(wrong(1, "not time_s and the 25 joints").into());
    }
    let row = |line: &str| {
        let mut values = line.split(',');
        let time: f64 = values.next()?.parse().ok()?;
        let angles = values.map(|value| value.parse().ok().filter(|angle: &f32| angle.is_finite()));
        let angles: Vec<f32> = angles.collect::<Option<_>>()?;
        let is_time = (0.0..1e9).contains(&time);
        is_time.then_some(Row {
            at_us: (time * 1e6).round() as u64,
            angles: angles.try_into().ok()?,
        })
    };
    let lines = text.lines().enumerate().skip(1);
    let rows = lines.map(|(k, line)| row(line).ok_or_else(|| wrong(k + 1, "no pose").into()));
    rows.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Nobody;
    use crate::training::motion::Motion;

    #[test]
    fn what_is_written_is_what_a_training_reads_and_nothing_is_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        let never = Interrupt::never().unwrap();
        let (poses, rows) = PosesFile::create(&path, &never, Some::<Row>).unwrap();
        for k in 0..60u16 {
            let angles = std::array::from_fn(|joint| 0.01 * f32::from(k) - 0.001 * joint as f32);
            let at_us = 28_000 * u64::from(k);
            rows.send(Row { at_us, angles }).unwrap();
        }
        drop(rows);
        let (count, written) = poses.finish();
        written.unwrap();
        assert_eq!(count, 60);
        let motion = Motion::open_for_training(Some(&path), 1, &Nobody).unwrap();
        let frames = motion.frames();
        assert_eq!(
            (frames.rows, frames.row(7)[3]),
            (60, 0.01 * 7.0 - 0.001 * 3.0)
        );
        assert!((motion.length_s().unwrap() - 59.0 * 0.028).abs() < 1e-6);
        let again = PosesFile::create(&path, &never, Some::<Row>).unwrap_err();
        assert!(again.to_string().contains("poses.csv"), "{again}");
    }

    #[test]
    fn a_file_without_a_row_is_taken_away() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        let never = Interrupt::never().unwrap();
        let (poses, rows) = PosesFile::create(&path, &never, Some::<Row>).unwrap();
        drop(rows);
        assert_eq!(poses.finish().0, 0);
        assert!(!path.exists());
    }

    /// A disk with room for so many bytes.
    struct Disk {
        holds: Vec<u8>,
        room: usize,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let taken = bytes.len().min(self.room - self.holds.len());
            if taken == 0 {
                return Err(std::io::ErrorKind::StorageFull.into());
            }
            self.holds.extend(&bytes[..taken]);
            Ok(taken)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl Cut for Disk {
        fn cut(&mut self, length: u64) -> std::io::Result<()> {
            self.holds.truncate(length as usize);
            Ok(())
        }

        fn sync(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_disk_of_any_size_keeps_whole_rows_and_those_that_are_counted() {
        let angles = [0.125; JOINT_COUNT];
        for room in 0..1_500 {
            let disk = Disk {
                holds: Vec::new(),
                room,
            };
            let mut to = Whole {
                file: disk,
                length: 0,
            };
            let mut count = 0;
            let rows = (0..40).map(|at_us| Row { at_us, angles });
            write(&mut to, rows, &mut count).expect_err("too little room");
            let kept = String::from_utf8(to.file.holds).unwrap();
            let rows = kept.lines().skip(1);
            assert_eq!(rows.clone().count() as u64, count, "{room}");
            assert!(rows.into_iter().all(|row| row.split(',').count() == 26));
            assert!(kept.is_empty() || kept.ends_with('\n'), "{room}: {kept}");
        }
    }

    #[test]
    fn rows_are_in_the_file_while_others_are_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        let never = Interrupt::never().unwrap();
        let (poses, rows) = PosesFile::create(&path, &never, Some::<Row>).unwrap();
        let angles = [0.5; JOINT_COUNT];
        rows.send(Row { at_us: 7, angles }).unwrap();
        let end = std::time::Instant::now() + std::time::Duration::from_secs(20);
        while std::fs::read_to_string(&path).unwrap().lines().count() < 2 {
            assert!(std::time::Instant::now() < end, "the row is kept back");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        drop(rows);
        assert_eq!(poses.finish().0, 1);
    }

    #[test]
    fn a_recording_that_ended_anywhere_goes_on_after_its_last_whole_row() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        let never = Interrupt::never().unwrap();
        let row = |k: u64| Row {
            at_us: 28_000 * k,
            angles: std::array::from_fn(|joint| 0.1 * k as f32 - joint as f32 / 3.0),
        };
        let (poses, rows) = PosesFile::create(&path, &never, Some::<Row>).unwrap();
        (0..5).for_each(|k| rows.send(row(k)).unwrap());
        drop(rows);
        assert_eq!(poses.finish().0, 5);
        let whole = std::fs::read(&path).unwrap();
        let ends: Vec<usize> = (1..=whole.len())
            .filter(|k| whole[k - 1] == b'\n')
            .collect();
        // About each line's end, and some places within.
        let near = |length: &usize| {
            length.is_multiple_of(97) || ends.iter().any(|end| end.abs_diff(*length) <= 1)
        };
        for length in (0..=whole.len()).filter(near) {
            std::fs::write(&path, &whole[..length]).unwrap();
            let (rows, poses, more) = PosesFile::go_on(&path, &never).unwrap();
            let count = ends
                .iter()
                .filter(|end| **end <= length)
                .count()
                .saturating_sub(1);
            let kept: Vec<Row> = (0..count as u64).map(row).collect();
            assert_eq!(rows, kept, "{length}");
            (rows.len() as u64..5).for_each(|k| more.send(row(k)).unwrap());
            drop(more);
            poses.finish().1.unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), whole, "{length}");
        }
        std::fs::write(&path, "a,b\n1,2\n").unwrap();
        let other = PosesFile::go_on(&path, &never).unwrap_err().to_string();
        assert!(other.contains("poses.csv, line 1: not time_s"), "{other}");
        assert_eq!(std::fs::read(&path).unwrap(), b"a,b\n1,2\n", "touched");
    }

    #[test]
    fn a_file_that_another_program_removed_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        let never = Interrupt::never().unwrap();
        let (poses, rows) = PosesFile::create(&path, &never, Some::<Row>).unwrap();
        let angles = [0.5; JOINT_COUNT];
        rows.send(Row { at_us: 7, angles }).unwrap();
        std::fs::remove_file(&path).unwrap();
        drop(rows);
        let error = poses.finish().1.unwrap_err().to_string();
        assert!(
            error.contains("poses.csv") && error.contains("removed it"),
            "{error}"
        );
    }

    #[test]
    fn a_file_that_could_not_be_written_is_named_with_the_rows_it_took() {
        let full = || Err(std::io::Error::from(std::io::ErrorKind::StorageFull));
        let poses = PosesFile {
            path: "/nowhere/hand.csv".into(),
            goes_on: false,
            writer: std::thread::spawn(move || (3, full())),
        };
        let (count, written) = poses.finish();
        let error = written.expect_err("the disk is full").to_string();
        assert_eq!(count, 3);
        assert!(error.contains("/nowhere/hand.csv"), "{error}");
    }
}
