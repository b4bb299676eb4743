//! A poses file that is being written: rows of joint angles with their times, by a thread of its own.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use anyhow::Result;
use glove::hand::{JOINT_COUNT, JOINT_NAMES};

use crate::failure::OrFail;
use crate::interrupt::Interrupt;

/// Rows that may wait for the disk: ten seconds at least.
const QUEUE: usize = 1024;

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
        mut row: impl FnMut(T) -> Option<Row> + Send + 'static,
    ) -> Result<(Self, SyncSender<T>)> {
        let name = || format!("the poses file {}", path.display());
        let file = File::create_new(path)
            .or_fail(name, "a new file's name, in a folder that you may write to")?;
        let (sender, given) = sync_channel(QUEUE);
        let interrupt = interrupt.clone();
        let writer = std::thread::Builder::new()
            .spawn(move || {
                let mut count = 0;
                let rows = given.iter().filter_map(&mut row);
                let written = write(file, rows, &mut count).and_then(|file| file.sync_all());
                if written.is_err() {
                    interrupt.ask();
                }
                (count, written)
            })
            .or_fail(name, "ending other programs")?;
        let poses = Self {
            path: path.to_owned(),
            writer,
        };
        Ok((poses, sender))
    }

    /// Waits for the last row; whoever gave rows has dropped the sender. Returns how many there are, and a failure that names the file
    /// where one could not be written. A file without one is taken away: it would stand in the way of the same command again.
    pub fn finish(self) -> (u64, Result<()>) {
        let stopped = || (0, Err(std::io::Error::other("its writer stopped")));
        let (count, written) = self.writer.join().unwrap_or_else(|_| stopped());
        if count == 0 {
            let _ = std::fs::remove_file(&self.path);
        }
        let name = || format!("the poses file {}", self.path.display());
        (count, written.or_fail(name, "room on the disk"))
    }
}

fn write<W: Write>(to: W, rows: impl Iterator<Item = Row>, count: &mut u64) -> std::io::Result<W> {
    let mut file = BufWriter::new(to);
    write!(file, "time_s")?;
    for name in JOINT_NAMES {
        write!(file, ",{name}")?;
    }
    writeln!(file)?;
    for row in rows {
        write!(file, "{:.6}", row.at_us as f64 / 1e6)?;
        for angle in row.angles {
            write!(file, ",{angle}")?;
        }
        writeln!(file)?;
        *count += 1;
    }
    file.into_inner()
        .map_err(std::io::IntoInnerError::into_error)
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

    #[test]
    fn a_disk_that_takes_no_more_leaves_the_rows_it_took_and_names_the_file() {
        let full = || Err(std::io::Error::from(std::io::ErrorKind::StorageFull));
        let poses = PosesFile {
            path: "/nowhere/hand.csv".into(),
            writer: std::thread::spawn(move || (3, full())),
        };
        let (count, written) = poses.finish();
        let error = written.expect_err("the disk is full").to_string();
        assert_eq!(count, 3);
        assert!(error.contains("/nowhere/hand.csv"), "{error}");
    }
}
