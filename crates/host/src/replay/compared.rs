//! Two bridges on the same log: by how much their maps' outputs and their commands differ.

use anyhow::Result;
use bridge::{App, Board};
use glove::hand::SEGMENT_COUNT;
use glove::imu::UniqueId;

use super::{Both, Changes, Follow, other, same};
use crate::failure::Failure;
use crate::recording::traced::Traced;
use crate::session::axes::Axes;

/// What a bridge made of one frame.
#[derive(Debug, Clone, Copy)]
struct Moment {
    frame: u32,
    at: u64,
    output: Option<Axes<f32>>,
    command: Option<Axes<f32>>,
}

#[derive(Debug, Default)]
struct Moments {
    all: Vec<Moment>,
    /// Time of the newest turn, µs.
    at: u64,
    /// After which there is nothing to compare with, µs.
    until: Option<u64>,
    /// The sensors' ids, as they are wired.
    ids: [Option<UniqueId>; SEGMENT_COUNT],
}

impl Follow for Moments {
    fn turn<B: Board<X>, const X: usize>(&mut self, app: &mut App<B, X>, at: u64) -> bool {
        self.at = at;
        self.ids = app.scanner_mut().ids();
        let seen = app.telemetry();
        let newest = self.all.last().map_or(0, |moment| moment.frame);
        if seen.frame_sequence != newest {
            self.all.push(Moment {
                frame: seen.frame_sequence,
                at,
                output: seen.map_output.map(Into::into),
                command: seen
                    .command
                    .filter(|_| seen.state.is_moving())
                    .map(|command| command.position.map(f32::from).into()),
            });
        }
        self.until.is_none_or(|until| at <= until)
    }
}

/// How far two runs are apart in one respect.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Apart {
    /// Frames in which both have a value.
    pub frames: u64,
    /// Frames in which one of them has none.
    pub one_sided: u64,
    /// Mean over frames and axes, counts.
    pub mean: f64,
    /// The greatest, counts.
    pub max: f64,
    /// When that was, µs in the log.
    pub max_at_us: u64,
    /// On which axis, from 0.
    pub max_axis: usize,
}

/// What another bridge would have done.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Compared {
    /// Frames of the log's own bridge.
    pub frames: u64,
    /// The maps' outputs.
    pub output: Apart,
    /// The positions commanded while the gripper followed the hand. The gripper in the log stays where it was, and no command
    /// leads it by more than 40 counts.
    pub command: Apart,
}

/// Replays the log with its own bridge and with another one; `follow` sees the turns of both, one after the other.
///
/// # Errors
/// As [`same`]; and another profile is not of the glove in the log.
pub fn compare(traced: &Traced, changes: &Changes, follow: &mut impl Follow) -> Result<Compared> {
    let mut ours = Moments::default();
    same(traced, &mut Both(&mut ours, follow))?;
    if let Some(Err(misfit)) = changes.profile.as_ref().map(|other| other.fits(&ours.ids)) {
        let log = traced.path.display();
        return Err(Failure::usage(
            format!("the profile is not of the glove in {log}: {misfit}"),
            "another profile of the same glove",
        )
        .into());
    }
    let mut theirs = Moments {
        until: Some(ours.at),
        ..Moments::default()
    };
    other(traced, changes, &mut Both(&mut theirs, follow))?;
    let mut theirs = theirs.all.iter().peekable();
    let (mut output, mut command) = (Sum::default(), Sum::default());
    for our in &ours.all {
        while theirs.next_if(|their| their.frame < our.frame).is_some() {}
        let their = theirs.peek().filter(|their| their.frame == our.frame);
        output.add(our.at, our.output, their.and_then(|their| their.output));
        command.add(our.at, our.command, their.and_then(|their| their.command));
    }
    Ok(Compared {
        frames: ours.all.len() as u64,
        output: output.apart(),
        command: command.apart(),
    })
}

#[derive(Debug, Default)]
struct Sum {
    apart: Apart,
    total: f64,
    values: u64,
}

impl Sum {
    fn add(&mut self, at: u64, ours: Option<Axes<f32>>, theirs: Option<Axes<f32>>) {
        let (ours, theirs) = match (ours, theirs) {
            (Some(ours), Some(theirs)) => (ours, theirs),
            (None, None) => return,
            _ => return self.apart.one_sided += 1,
        };
        self.apart.frames += 1;
        for (axis, (our, their)) in ours.iter().zip(theirs.iter()).enumerate() {
            let by = f64::from((our - their).abs());
            self.total += by;
            self.values += 1;
            if by > self.apart.max {
                (self.apart.max, self.apart.max_at_us, self.apart.max_axis) = (by, at, axis);
            }
        }
    }

    fn apart(self) -> Apart {
        Apart {
            mean: self.total / self.values.max(1) as f64,
            ..self.apart
        }
    }
}
