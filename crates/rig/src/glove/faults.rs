//! What a test may do to the glove, and what it may look at.

use super::VirtualGlove;
use super::upset::{Met, Upset, Upsets};
use crate::clock::lock;
use crate::{Duration, Instant, PoseSource};

/// Counters of the virtual glove.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Messages that went onto the I2C bus.
    pub transactions: u64,
    /// Of these, the ones nobody acknowledged.
    pub nacks: u64,
    /// Bytes lost because they came while the bus was busy and the FIFO full.
    pub overflows: u64,
    /// Messages with more than 16 data bytes, which did nothing.
    pub refusals: u64,
}

/// Faults and truth. Sensors are numbered as the segments, 0 to 15; another number does nothing.
impl VirtualGlove {
    /// Puts the sensor that was built as number `built_as` in place of sensor `index`: its unique id is another. The sensor that
    /// was there has its own number.
    pub fn exchange_sensor(&self, index: usize, built_as: usize) {
        self.sensor(index, |chip| chip.exchange(built_as));
    }

    /// Asks the hand to lie flat until it is asked to move again; a hand that only plays its motion does not.
    pub fn lie_flat(&self, flat: bool) {
        lock(&self.state).hand.pose.lie_flat(flat);
    }

    /// Asks the person whose hand it is for something, from now on; a hand that only plays its motion does not hear.
    pub fn ask(&self, task: crate::person::Task) {
        lock(&self.state).hand.pose.ask(task);
    }

    /// Takes sensor `index` off the bus (every access is a NACK), or puts it back as it was.
    pub fn unplug(&self, index: usize, unplugged: bool) {
        self.sensor(index, |chip| chip.faults.unplugged = unplugged);
    }

    /// Sensor `index` resets at `now` and boots for 650 ms, in CONFIG mode after that.
    pub fn reset_sensor(&self, index: usize, now: Instant) {
        self.sensor(index, |chip| chip.reset_and_boot(now));
    }

    /// Sensor `index` resets just before its next read, so that this one starts at register 0
    /// (A0 FB 32 0F …); it answers at once, in CONFIG mode.
    pub fn reset_in_read(&self, index: usize) {
        self.sensor(index, |chip| chip.faults.reset_in_read = true);
    }

    /// Flips bit 15 of quaternion `component` (0 w to 3 z) in the next `reads` reads of sensor `index`.
    pub fn flip_bit15(&self, index: usize, component: usize, reads: u32) {
        self.sensor(index, |chip| chip.faults.flip = Some((component, reads)));
    }

    /// Stops the output of sensor `index`: it repeats its last sample.
    pub fn freeze(&self, index: usize, frozen: bool) {
        self.sensor(index, |chip| chip.faults.frozen = frozen);
    }

    /// Register `address` of page 0 of sensor `index` keeps its value, whatever is written into it.
    pub fn stick_register(&self, index: usize, address: u8) {
        self.sensor(index, |chip| chip.faults.stuck = Some(address));
    }

    /// The next `count` accesses of sensor `index` are not acknowledged.
    pub fn nack(&self, index: usize, count: u32) {
        self.sensor(index, |chip| chip.faults.nacks = count);
    }

    /// Sensor `index` stretches the clock by `per_byte` on every data byte.
    pub fn stretch(&self, index: usize, per_byte: Duration) {
        self.sensor(index, |chip| chip.faults.stretch = Some(per_byte));
    }

    /// A line of the I2C bus is stuck low: messages end by the bridge's timeout, if it is enabled, else
    /// not before the bus is free again.
    pub fn dead_bus(&self, dead: bool) {
        lock(&self.state).bus.dead = dead;
    }

    /// Takes the multiplexer, and with it all sensors, off the bus.
    pub fn unplug_mux(&self, unplugged: bool) {
        lock(&self.state).bus.mux_unplugged = unplugged;
    }

    /// Leaves the multiplexer's `channel` connected whatever is selected, while what was selected reads back right; `None` lets
    /// it select again.
    pub fn stick_mux(&self, channel: Option<u8>) {
        lock(&self.state).bus.mux_stuck =
            channel.map(|channel| 1u8.checked_shl(channel.into()).unwrap_or(0));
    }

    /// Sets the multiplexer's address pins: it answers at `address`, 0x70 to 0x77.
    pub fn set_mux_address(&self, address: u8) {
        lock(&self.state).bus.mux_address = address;
    }

    /// Resets the multiplexer: no channel is connected.
    pub fn reset_mux(&self) {
        lock(&self.state).bus.channels = 0;
    }

    /// Resets the serial bridge at `now`: 9,600 baud, `OK`.
    pub fn reset_bridge(&self, now: Instant) {
        lock(&self.state).bridge.reset(now);
    }

    /// Switches the glove's power off, in whatever it is doing: it is silent and deaf. Or on again at `now`: the serial bridge
    /// is as after a reset (9,600 baud, `OK`), the multiplexer has no channel connected, every sensor boots for 650 ms, in
    /// CONFIG mode after that.
    pub fn power(&self, on: bool, now: Instant) {
        let mut state = lock(&self.state);
        state.off = !on;
        if on {
            state.bridge.reset(now);
            state.bus.channels = 0;
            for chip in &mut state.bus.sensors {
                chip.reset_and_boot(now);
            }
        }
    }

    /// Cuts the next `count` answers to `bytes` bytes.
    pub fn cut_answers(&self, bytes: usize, count: u32) {
        lock(&self.state).bridge.short_answers = (bytes, count);
    }

    /// Turns the world of sensor `index` by `radians` about the vertical: in IMU mode there is no compass,
    /// and a sensor that starts anew takes its heading of that moment for its own.
    pub fn set_heading(&self, index: usize, radians: f32) {
        let axis = nalgebra::Vector3::z_axis();
        if let Some(heading) = lock(&self.state).hand.heading.get_mut(index) {
            *heading = nalgebra::UnitQuaternion::from_axis_angle(&axis, radians);
        }
    }

    /// Puts another source of poses in place.
    pub fn set_pose(&self, pose: Box<dyn PoseSource>) {
        lock(&self.state).hand.pose = pose;
    }

    /// What sensor `index` would measure at `at`, before rounding, w x y z.
    #[must_use]
    pub fn true_orientation(&self, index: usize, at: Instant) -> [f32; 4] {
        let mut state = lock(&self.state);
        let index = index.min(15);
        let start = state.bus.sensors[index].starts;
        let dither = state.hand.dither.take();
        state.hand.be_quiet(true);
        let orientation = state.hand.orientation(index, start, at);
        state.hand.be_quiet(false);
        state.hand.dither = dither;
        orientation
    }

    /// Sensor `index` of an honest glove slips: from now on it sits turned by `degrees` about `axis`, a direction in the frame of the
    /// segment it sits on.
    pub fn slip(&self, index: usize, axis: [f64; 3], degrees: f64) {
        if let Some(worn) = &mut lock(&self.state).hand.honest {
            worn.slip(index, axis, degrees);
        }
    }

    /// Sensor `index` (each, where there is no such) is as a program leaves it that brought it up: booted and in IMU mode, with a
    /// heading of its own; its 100 Hz began less than 10 ms before `now`.
    pub fn bring_up(&self, index: usize, now: Instant) {
        let mut state = lock(&self.state);
        let super::State { bus, hand, .. } = &mut *state;
        let chips = bus.sensors.iter_mut().enumerate();
        for (k, chip) in chips.filter(|(k, _)| *k == index || index > 15) {
            let phase = hand.honest.as_ref().map_or(0.0, |worn| worn.phase(k));
            let before = (phase * super::FUSION_PERIOD.as_ticks() as f64) as u64;
            let since = Instant::from_ticks(now.as_ticks().saturating_sub(before));
            chip.run_since(since, now);
        }
    }

    /// The eight bytes that a read of sensor `index` at its quaternion's registers gives at `now`, past bus and wire: for tests that
    /// need many samples. `None` where it does not acknowledge. Times must not go back.
    #[must_use]
    pub fn read_sample(&self, index: usize, now: Instant) -> Option<[u8; 8]> {
        let mut state = lock(&self.state);
        let super::State { bus, hand, off, .. } = &mut *state;
        let chip = bus.sensors.get_mut(index).filter(|_| !*off)?;
        chip.sample(now, &mut |start, at| hand.orientation(index, start, at))
    }

    /// A register of sensor `index` as a read would show it, without touching the chip's pointer.
    #[must_use]
    pub fn sensor_register(&self, index: usize, page: usize, address: u8) -> u8 {
        lock(&self.state).bus.sensors[index.min(15)].register(page, address)
    }

    /// Operation mode of sensor `index`: 0 CONFIG, 8 IMU, 0C NDOF.
    #[must_use]
    pub fn sensor_mode(&self, index: usize) -> u8 {
        lock(&self.state).bus.sensors[index.min(15)].mode()
    }

    /// A register of the serial bridge.
    #[must_use]
    pub fn bridge_register(&self, address: usize) -> u8 {
        lock(&self.state).bridge.register(address)
    }

    /// The multiplexer's connected channels, one bit each.
    #[must_use]
    pub fn channels(&self) -> u8 {
        lock(&self.state).bus.channels
    }

    /// Whether every sensor on the bus has booted by `now`.
    #[must_use]
    pub fn booted(&self, now: Instant) -> bool {
        let state = lock(&self.state);
        !state.off && state.bus.sensors.iter().all(|chip| chip.booted(now))
    }

    /// What it has counted.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let state = lock(&self.state);
        Counters {
            transactions: state.bus.transactions,
            nacks: state.bus.nacks,
            overflows: state.bridge.overflows,
            refusals: state.bridge.refusals,
        }
    }

    fn sensor(&self, index: usize, act: impl FnOnce(&mut super::bno055::Bno055)) {
        if let Some(chip) = lock(&self.state).bus.sensors.get_mut(index) {
            act(chip);
        }
    }

    /// Message `number` on the I2C bus goes wrong; they are counted from 0, and [`super::Counters::transactions`] is the number of
    /// the next. One at a time: another call takes the place of one that has not happened yet.
    pub fn upset(&self, number: u64, upset: Upset) {
        lock(&self.state).bus.upsets = Upsets::of(number, upset);
    }

    /// Whom the upset message was for, if it has come.
    #[must_use]
    pub fn upset_met(&self) -> Option<Met> {
        lock(&self.state).bus.upsets.whom()
    }
}
