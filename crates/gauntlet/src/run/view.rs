//! The view of a run, put together.

use std::time::{Duration, Instant};

use host::bridge::State;
use host::bridge::calibration::Lack;
use host::bridge::clutch::Position;

use super::shown::{self, Hands};
use super::{Options, Run};
use crate::live::{Bindings, View, headings};
use host::next::Command;
use host::session::{CLOSED_TOO_LATE, Devices, Snapshot};

impl Run {
    pub(super) fn view(&mut self, options: &Options, elapsed: Duration, keys: bool) -> View {
        let snapshot = self.session.snapshot();
        let progress = self.session.hub().progress();
        let mut view = View {
            title: match self.finds_flat {
                true => options.title.to_owned(),
                false => format!("{}, finds no flat poses", options.title),
            },
            elapsed,
            total: options.seconds,
            state: "starting".to_owned(),
            following: false,
            fingers: Vec::new(),
            hand_age: None,
            headings: Vec::new(),
            axes: Vec::new(),
            gripper_age: None,
            frames_per_s: progress.frames_per_s,
            cycles_per_s: progress.cycles_per_s,
            latency_p50: progress.latency_p50,
            latency_p99: progress.latency_p99,
            dropped: progress.dropped,
            faults: self.faults_now(
                snapshot.as_ref(),
                &self.hands(snapshot.as_ref(), keys, options.drives),
            ),
            gripper_faults: progress.gripper_faults,
            keys: key_words(keys, options.drives),
        };
        if let Some(address) = self.page_address() {
            view.keys = format!("{}   page: {address}", view.keys);
        }
        if let Some(snapshot) = &snapshot {
            view.state = self.state_words(snapshot, keys && options.drives);
            view.following = snapshot.state.is_moving();
            view.fingers = shown::fingers(snapshot);
            view.hand_age = shown::glove_age(snapshot);
            view.headings = headings::of(snapshot.headings);
            view.axes = self.shown.axes(snapshot, Instant::now());
            view.gripper_age = shown::gripper_age(snapshot);
        }
        view
    }

    /// What whoever watches can do.
    fn hands(&self, snapshot: Option<&Snapshot>, keys: bool, drives: bool) -> Hands {
        let lack = snapshot.and_then(Snapshot::lacks);
        match &self.devices {
            Devices::Here { glove, .. }
                if !self.straight && matches!(lack, Some(Lack::Profile | Lack::OwnProfile)) =>
            {
                Hands::Profile(Command::gauntlet("calibrate").path("--glove", glove))
            }
            devices => Hands::of(keys, drives, devices),
        }
    }

    /// The state, and what a person can do about it.
    fn state_words(&self, snapshot: &Snapshot, keys: bool) -> String {
        let name = snapshot.state.name();
        if snapshot.lacks_calibration() && snapshot.state == State::Idle {
            return format!("{name}: not calibrated");
        }
        if keys && !self.clutch.closed {
            let space = Bindings::name(Bindings::load().clutch);
            match snapshot.clutch {
                Position::Open => return format!("{name}: {space} closes the clutch"),
                Position::Expired => return format!("{name}: {space} closes the clutch again"),
                Position::Closed | Position::Lost => {}
            }
        }
        name.to_owned()
    }

    fn faults_now(&mut self, snapshot: Option<&Snapshot>, hands: &Hands) -> Vec<String> {
        let mut faults = Vec::new();
        for (device, port) in self.session.ports() {
            if !port.plugged() {
                faults.push(format!(
                    "{device}: {} is unplugged, waiting for it to come back",
                    port.path().display()
                ));
            }
        }
        faults.extend(self.log_end());
        faults.extend(self.clutch.why_expired().map(str::to_owned));
        if self.clutch.too_late {
            faults.push(CLOSED_TOO_LATE.to_owned());
        }
        if let Some(snapshot) = snapshot {
            let scheduling = self.session.scheduling();
            let now = Instant::now();
            faults.extend(self.shown.faults(snapshot, scheduling, hands, now));
        }
        faults
    }
}

/// What keys do.
fn key_words(keys: bool, drives: bool) -> String {
    let bindings = Bindings::load();
    let [clutch, calibrate, undo, end] = [
        bindings.clutch,
        bindings.calibrate,
        bindings.undo,
        bindings.end,
    ]
    .map(Bindings::name);
    match (keys, drives) {
        (true, true) => format!(
            "{clutch}: clutch   {calibrate}: calibrate on a flat hand   {undo}: undo that   {end}: hold and end"
        ),
        (true, false) => format!("{end}: end"),
        (false, true) => "Ctrl-C: hold and end".to_owned(),
        (false, false) => "Ctrl-C: end".to_owned(),
    }
}
