//! The view of a watch, put together.

use bridge::State;
use bridge::protocol::message::{Sample, Status};
use gripper::{Activation, Fault};

use super::{Options, Watch};
use crate::live::{Axis, Finger, View};
use host::words;

impl Watch<'_> {
    pub(super) fn view(&mut self, options: &Options) -> View {
        let now_us = self.sample.as_ref().map_or(0, |sample| sample.now_us);
        let state = self
            .sample
            .as_ref()
            .map(|sample| sample.state)
            .or(self.status.as_ref().map(|status| status.state));
        View {
            title: options.title.to_owned(),
            elapsed: self.started.elapsed(),
            total: options.seconds,
            state: state.as_ref().map_or("starting", State::name).to_owned(),
            following: state.is_some_and(|state| state.is_moving()),
            fingers: self.sample.as_ref().map(fingers).unwrap_or_default(),
            hand_age: None,
            axes: self.sample.as_ref().map(axes).unwrap_or_default(),
            gripper_age: None,
            frames_per_s: self.frames.now(now_us),
            cycles_per_s: self.cycles_per_s,
            latency_p50: self.latency.at(0.5),
            latency_p99: self.latency.at(0.99),
            dropped: 0,
            faults: self.faults(state),
            fault_count: self
                .counted
                .map_or(0, |(_, counters)| counters.faults.into()),
            keys: if options.engage {
                "space: close or open the clutch   q: open it and end"
            } else {
                "q: end"
            },
        }
    }

    fn faults(&self, state: Option<State>) -> Vec<String> {
        let mut faults: Vec<String> = match state {
            Some(state @ (State::Holding(_) | State::SafeAction(_) | State::Faulted(_))) => {
                vec![state.to_string()]
            }
            _ => Vec::new(),
        };
        if self.expired {
            faults.push("the clutch opened by itself: space closes it again".to_owned());
        }
        if let Some(status) = &self.status {
            faults.extend(standing_faults(status));
        }
        faults
    }
}

/// What is wrong with the bridge's devices now.
pub fn standing_faults(status: &Status) -> Vec<String> {
    let mut faults = Vec::new();
    if !status.glove_answers {
        faults.push("the glove sends no frames".to_owned());
    }
    match &status.gripper {
        None => faults.push("the gripper does not answer".to_owned()),
        Some(gripper) => {
            if gripper.activation != Activation::Ready {
                faults.push(format!(
                    "the gripper is {}",
                    words::activation(gripper.activation)
                ));
            }
            if gripper.fault != Fault::None {
                faults.push(format!(
                    "gripper fault {:02X}: {}; {}",
                    gripper.fault.code(),
                    gripper.fault.sentence(),
                    gripper.fault.action()
                ));
            }
        }
    }
    faults
}

fn fingers(sample: &Sample) -> Vec<Finger> {
    let limits = &glove::hand::LIMITS;
    words::FINGER_NAMES
        .iter()
        .enumerate()
        .map(|(finger, name)| Finger {
            name,
            angles: core::array::from_fn(|joint| sample.angles[5 * finger + joint]),
            limits: core::array::from_fn(|joint| limits[5 * finger + joint]),
            good: true,
        })
        .collect()
}

fn axes(sample: &Sample) -> Vec<Axis> {
    words::AXIS_WORDS
        .iter()
        .enumerate()
        .map(|(axis, name)| Axis {
            name,
            asked: sample.command.get(axis).copied(),
            reached: sample.position.get(axis).copied(),
            word: "",
        })
        .collect()
}
