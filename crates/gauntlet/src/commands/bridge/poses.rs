//! A recording of a hand from a bridge on a chip: its telemetry samples as rows of a poses file.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use anyhow::Result;
use bridge::protocol::message::Sample;

use host::failure::OrFail;
use host::interrupt::Interrupt;

/// Samples that may wait for the disk: 50 s.
const QUEUE: usize = 1024;

/// A poses file being written, by a thread of its own.
#[derive(Debug)]
pub(super) struct Poses {
    path: PathBuf,
    writer: JoinHandle<(u64, std::io::Result<()>)>,
}

impl Poses {
    /// Creates the file, never over one that is there; and where the samples go. A disk that takes no more asks for the end.
    ///
    /// # Errors
    /// A failure that names the file.
    pub(super) fn create(path: &Path, interrupt: &Interrupt) -> Result<(Self, SyncSender<Sample>)> {
        let name = || format!("the log {}", path.display());
        let file = File::create_new(path)
            .or_fail(name, "a new file's name, in a folder that you may write to")?;
        let (sender, samples) = sync_channel(QUEUE);
        let interrupt = interrupt.clone();
        let writer = std::thread::Builder::new()
            .spawn(move || {
                let mut rows = 0;
                let written = write(file, &samples, &mut rows).and_then(|file| file.sync_all());
                if written.is_err() {
                    interrupt.ask();
                }
                (rows, written)
            })
            .or_fail(name, "ending other programs")?;
        let poses = Self {
            path: path.to_owned(),
            writer,
        };
        Ok((poses, sender))
    }

    /// Waits for the last row; the session has ended. Returns how many there are, and a failure that names the file where one
    /// could not be written. A file without one is taken away: it would stand in the way of the same command again.
    pub(super) fn finish(self) -> (u64, Result<()>) {
        let stopped = || (0, Err(std::io::Error::other("its writer stopped")));
        let (rows, written) = self.writer.join().unwrap_or_else(|_| stopped());
        if rows == 0 {
            let _ = std::fs::remove_file(&self.path);
        }
        let name = || format!("the log {}", self.path.display());
        (rows, written.or_fail(name, "room on the disk"))
    }
}

/// The poses of `samples`. A frame of which a row was written already, and one that gave no angles (the bridge repeats its last
/// ones then, to the bit), are no new pose.
fn write<W: Write>(to: W, samples: &Receiver<Sample>, rows: &mut u64) -> std::io::Result<W> {
    let mut file = BufWriter::new(to);
    write!(file, "time_s")?;
    for name in glove::hand::JOINT_NAMES {
        write!(file, ",{name}")?;
    }
    writeln!(file)?;
    // Before the first frame there is no pose.
    let (mut last_frame, mut last) = (0, None);
    for sample in samples {
        if std::mem::replace(&mut last_frame, sample.frame_sequence) == sample.frame_sequence {
            continue;
        }
        let angles = sample.angles.map(f32::to_bits);
        if last.replace(angles) == Some(angles) {
            continue;
        }
        write!(file, "{:.6}", sample.now_us as f64 / 1e6)?;
        for angle in sample.angles {
            write!(file, ",{angle}")?;
        }
        writeln!(file)?;
        *rows += 1;
    }
    file.into_inner()
        .map_err(std::io::IntoInnerError::into_error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridge::State;
    use glove::hand::JOINT_COUNT;

    #[test]
    fn a_frame_that_gave_no_angles_is_no_row_of_old_ones() {
        let sample = |frame_sequence, angle| Sample {
            now_us: 40_000 * u64::from(frame_sequence),
            state: State::Idle,
            frame_sequence,
            angles: [angle; JOINT_COUNT],
            target: Default::default(),
            command: Default::default(),
            position: Default::default(),
            latency_us: None,
        };
        let (sender, samples) = sync_channel(QUEUE);
        for (sequence, angle) in [
            (0, 0.0),
            (1, 0.25),
            (1, 0.25),
            (2, 0.25),
            (3, 0.25),
            (4, 0.5),
        ] {
            sender.try_send(sample(sequence, angle)).expect("room");
        }
        drop(sender);
        let mut rows = 0;
        let bytes = write(Vec::new(), &samples, &mut rows).expect("memory takes all");
        let text = String::from_utf8(bytes).expect("text");
        let times: Vec<&str> = text
            .lines()
            .skip(1)
            .filter_map(|row| row.split(',').next())
            .collect();
        assert_eq!((rows, times), (2, vec!["0.040000", "0.160000"]));
    }
    #[test]
    fn a_disk_that_takes_no_more_leaves_the_rows_it_took_and_names_the_file() {
        let full = || Err(std::io::Error::from(std::io::ErrorKind::StorageFull));
        let poses = Poses {
            path: "/nowhere/hand.csv".into(),
            writer: std::thread::spawn(move || (3, full())),
        };
        let (rows, written) = poses.finish();
        let error = written.expect_err("the disk is full").to_string();
        assert_eq!(rows, 3);
        assert!(error.contains("/nowhere/hand.csv"), "{error}");
    }
}
