//! The virtual glove against literal byte strings of the data sheets, with no driver in between.
#![allow(clippy::unwrap_used)]

use embedded_io::{Read, ReadReady, Write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::glove::{Config, VirtualGlove};
use rig::{Clock, Duration, Instant, MemoryWire};

/// A glove on a wire, and the clock that both live on.
struct Bench {
    clock: Clock,
    glove: VirtualGlove,
    wire: MemoryWire,
}

const CHANNEL_0: [u8; 5] = [0x53, 0xE0, 0x01, 0x01, 0x50];
const QUATERNION_29: [u8; 8] = [0x53, 0x52, 0x01, 0x20, 0x53, 0x53, 0x08, 0x50];
const IMU_MODE_28: [u8; 6] = [0x53, 0x50, 0x02, 0x3D, 0x08, 0x50];
const STATUS: [u8; 3] = [0x52, 0x0A, 0x50];

fn flat(_: f64) -> [f32; 25] {
    [0.0; 25]
}

impl Bench {
    fn with(config: Config, pose: impl FnMut(f64) -> [f32; 25] + Send + 'static) -> Self {
        let clock = Clock::new();
        let baud = config.baud;
        let glove = VirtualGlove::new(Box::new(pose), config);
        let wire = MemoryWire::new(&clock, glove.clone(), baud);
        Self { clock, glove, wire }
    }

    /// At 460,800 baud, exact samples, booted.
    fn booted(pose: impl FnMut(f64) -> [f32; 25] + Send + 'static) -> Self {
        let config = Config {
            dither: None,
            ..Config::at_baud(460_800)
        };
        let bench = Self::with(config, pose);
        bench.clock.set(Instant::from_ticks(700_000));
        bench
    }

    fn send(&mut self, bytes: &[u8]) {
        assert_eq!(self.wire.write(bytes).unwrap(), bytes.len());
    }

    fn wait_ms(&self, ms: u64) {
        self.clock.advance(Duration::from_millis(ms));
    }

    fn drain(&mut self) -> Vec<u8> {
        let mut all = Vec::new();
        let mut chunk = [0; 64];
        while self.wire.read_ready().unwrap() {
            let count = self.wire.read(&mut chunk).unwrap();
            all.extend_from_slice(&chunk[..count]);
        }
        all
    }

    /// Sends, waits until everything is over, gives back what came.
    fn ask(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.send(bytes);
        while let Some(event) = self.clock.next_event() {
            self.clock.set(event);
        }
        self.drain()
    }

    /// Puts the sensor at `address` of the connected channel into IMU mode and waits for its output.
    fn start_fusion(&mut self, address: u8) {
        self.ask(&[0x53, address << 1, 0x02, 0x3D, 0x08, 0x50]);
        self.wait_ms(7 + 10);
    }

    fn quaternion(&mut self, address: u8) -> [i16; 4] {
        let (write, read) = (address << 1, address << 1 | 1);
        let bytes = self.ask(&[0x53, write, 0x01, 0x20, 0x53, read, 0x08, 0x50]);
        let bytes: [u8; 8] = bytes.try_into().expect("8 bytes");
        core::array::from_fn(|i| i16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]))
    }
}

#[test]
fn after_reset_it_says_ok_at_9600_and_changes_its_baud_when_brg1_is_written() {
    let mut bench = Bench::with(Config::default(), flat);
    bench.wait_ms(10);
    assert_eq!(bench.drain(), b"OK");
    assert_eq!(
        bench.ask(&[0x52, 0x00, 0x01, 0x0A, 0x50]),
        [0xF0, 0x02, 0xF0]
    );
    // BRG0 alone changes nothing yet.
    bench.ask(&[0x57, 0x00, 0x30, 0x50]);
    assert_eq!(bench.ask(&STATUS), [0xF0]);
    bench.ask(&[0x57, 0x00, 0x30, 0x01, 0x00, 0x50]);
    assert_ne!(bench.ask(&STATUS), [0xF0], "the old speed is noise now");
    bench.wire.set_baud(115_200);
    bench.wait_ms(700);
    assert_eq!(bench.ask(&STATUS), [0xF0]);
    // 460,800 is divider 0000.
    bench.ask(&[0x57, 0x00, 0x00, 0x01, 0x00, 0x50]);
    bench.wire.set_baud(460_800);
    assert_eq!(bench.ask(&STATUS), [0xF0]);
}

#[test]
fn after_a_new_baud_what_begins_within_a_millisecond_is_lost_and_nothing_after_it() {
    // A status is three characters: 65 us at 460,800.
    for (pause_us, answers) in [
        (0, false),
        (500, false),
        (900, false),
        (1_000, true),
        (2_000, true),
    ] {
        let mut bench = Bench::with(Config::at_baud(115_200), flat);
        bench.send(&[0x57, 0x00, 0x00, 0x01, 0x00, 0x50]);
        // Six characters of 86.8 us.
        bench.clock.advance(Duration::from_micros(521));
        bench.wire.set_baud(460_800);
        bench.clock.advance(Duration::from_micros(pause_us));
        bench.send(&STATUS);
        bench.wait_ms(5);
        let answer = bench.drain();
        assert_eq!(answer == [0xF0], answers, "{pause_us} us: {answer:02X?}");
    }
}

#[test]
fn a_speed_changed_before_the_command_has_left_spoils_the_command() {
    let mut bench = Bench::with(Config::at_baud(115_200), flat);
    bench.send(&[0x57, 0x00, 0x00, 0x01, 0x00, 0x50]);
    bench.clock.advance(Duration::from_micros(200));
    bench.wire.set_baud(460_800);
    bench.wait_ms(5);
    bench.drain();
    assert_eq!(rig::Device::baud(&bench.glove), 115_200);
}

#[test]
fn a_baud_counts_from_the_stop_of_its_message_and_the_command_behind_it_is_lost() {
    let mut bench = Bench::with(Config::at_baud(115_200), flat);
    let message = [0x57, 0x00, 0x10, 0x01, 0x00, 0x50];
    bench.send(&message[..5]);
    bench.wait_ms(1);
    assert_eq!(bench.drain(), []);
    assert_eq!(rig::Device::baud(&bench.glove), 115_200);
    bench.send(&message[5..]);
    bench.send(&STATUS);
    bench.wait_ms(1);
    assert!(!bench.drain().contains(&0xF0));
    assert_eq!(rig::Device::baud(&bench.glove), 230_400);
    bench.wire.set_baud(230_400);
    bench.wait_ms(700);
    assert_eq!(bench.ask(&STATUS), [0xF0]);
}

#[test]
fn golden_strings_select_a_channel_start_fusion_and_read_eight_bytes() {
    let mut bench = Bench::booted(flat);
    assert_eq!(bench.ask(&CHANNEL_0), []);
    assert_eq!(bench.glove.channels(), 0x01);
    assert_eq!(bench.ask(&IMU_MODE_28), []);
    bench.wait_ms(7);
    assert_eq!(
        bench.ask(&[0x53, 0x50, 0x01, 0x3D, 0x53, 0x51, 0x01, 0x50]),
        [0x08]
    );
    assert_eq!(bench.ask(&QUATERNION_29), [0; 8], "still in CONFIG");
    bench.ask(&[0x53, 0x52, 0x02, 0x3D, 0x08, 0x50]);
    bench.wait_ms(17);
    assert_eq!(
        bench.ask(&QUATERNION_29),
        [0x00, 0x40, 0, 0, 0, 0, 0, 0],
        "identity is w = 2^14"
    );
    assert_eq!(bench.ask(&STATUS), [0xF0]);
}

#[test]
fn addresses_and_data_that_look_like_commands_are_taken_by_length() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    // Every data byte a `P`; into the calibration, registers 55 to 5A, and read back.
    bench.ask(&[
        0x53, 0x50, 0x07, 0x55, b'P', b'P', b'S', b'R', b'P', b'W', 0x50,
    ]);
    let back = bench.ask(&[0x53, 0x50, 0x01, 0x55, 0x53, 0x51, 0x06, 0x50]);
    assert_eq!(back, b"PPSRPW");
}

#[test]
fn sensors_give_nacks_for_650_ms_after_power_on_and_after_a_reset() {
    let mut bench = Bench::with(Config::at_baud(460_800), flat);
    let chip_id = [0x53, 0x50, 0x01, 0x00, 0x53, 0x51, 0x04, 0x50];
    bench.ask(&CHANNEL_0);
    bench.clock.set(Instant::from_ticks(648_000));
    assert_eq!(bench.ask(&chip_id), []);
    assert_eq!(bench.ask(&STATUS), [0xF1]);
    bench.clock.set(Instant::from_ticks(650_000));
    assert_eq!(bench.ask(&chip_id), [0xA0, 0xFB, 0x32, 0x0F]);
    assert_eq!(bench.ask(&STATUS), [0xF0]);
    bench.ask(&[0x53, 0x50, 0x02, 0x3F, 0x20, 0x50]);
    bench.wait_ms(648);
    assert_eq!(bench.ask(&chip_id), []);
    bench.wait_ms(2);
    assert_eq!(bench.ask(&chip_id), [0xA0, 0xFB, 0x32, 0x0F]);
}

#[test]
fn a_mode_switch_takes_7_ms_from_config_and_19_ms_back() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    let mode = [0x53, 0x50, 0x01, 0x3D, 0x53, 0x51, 0x01, 0x50];
    bench.ask(&IMU_MODE_28);
    bench.wait_ms(5);
    assert_eq!(bench.ask(&mode), [0x00]);
    bench.wait_ms(2);
    assert_eq!(bench.ask(&mode), [0x08]);
    // No output yet: the first comes one fusion period later.
    assert_eq!(bench.quaternion(0x28), [0; 4]);
    bench.wait_ms(10);
    assert_eq!(bench.quaternion(0x28), [16_384, 0, 0, 0]);
    bench.ask(&[0x53, 0x50, 0x02, 0x3D, 0x00, 0x50]);
    bench.wait_ms(17);
    assert_eq!(bench.ask(&mode), [0x08]);
    bench.wait_ms(2);
    assert_eq!(bench.ask(&mode), [0x00]);
    assert_eq!(bench.quaternion(0x28), [0; 4]);
}

#[test]
fn the_register_pointer_stays_where_it_was_written() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    bench.ask(&[0x53, 0x50, 0x01, 0x01, 0x50]);
    // A plain read starts there again each time, and counts on inside.
    assert_eq!(bench.ask(&[0x53, 0x51, 0x02, 0x50]), [0xFB, 0x32]);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x03, 0x50]), [0xFB, 0x32, 0x0F]);
    // So does one after a register was written: UNIT_SEL, then the one behind it.
    bench.ask(&[0x53, 0x50, 0x02, 0x3B, 0x01, 0x50]);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x01, 0x50]), [0x01]);
    // 7F is the last of a page.
    bench.ask(&[0x53, 0x50, 0x01, 0x7F, 0x50]);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x02, 0x50]), [0x00, 0xA0]);
}

#[test]
fn outside_config_only_the_mode_can_be_written() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    bench.ask(&[0x53, 0x50, 0x02, 0x3B, 0x00, 0x50]);
    assert_eq!(bench.glove.sensor_register(0, 0, 0x3B), 0x00);
    bench.start_fusion(0x28);
    for (register, before) in [(0x3B, 0x00), (0x3E, 0x00), (0x41, 0x24), (0x55, 0x00)] {
        bench.ask(&[0x53, 0x50, 0x02, register, 0x02, 0x50]);
        assert_eq!(
            bench.glove.sensor_register(0, 0, register),
            before,
            "{register:02X}"
        );
    }
    // Neither ids nor results can be written in any mode.
    bench.ask(&[0x53, 0x52, 0x03, 0x00, 0x11, 0x22, 0x50]);
    assert_eq!(bench.glove.sensor_register(1, 0, 0x00), 0xA0);
    assert_eq!(bench.glove.sensor_register(1, 0, 0x01), 0xFB);
}

#[test]
fn status_registers_tell_fusion_and_calibration() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    let status = [0x53, 0x50, 0x01, 0x39, 0x53, 0x51, 0x02, 0x50];
    assert_eq!(bench.ask(&status), [0, 0]);
    bench.start_fusion(0x28);
    assert_eq!(bench.ask(&status), [5, 0]);
    let calibration = [0x53, 0x50, 0x01, 0x35, 0x53, 0x51, 0x01, 0x50];
    assert_eq!(bench.ask(&calibration), [0xFC]);
}

#[test]
fn each_sensor_has_its_own_id_on_page_1() {
    let mut bench = Bench::booted(flat);
    let mut ids = std::collections::BTreeSet::new();
    for sensor in 0..16u8 {
        let address = 0x28 + sensor % 2;
        bench.ask(&[0x53, 0xE0, 0x01, 1 << (sensor / 2), 0x50]);
        bench.ask(&[0x53, address << 1, 0x02, 0x07, 0x01, 0x50]);
        let id = bench.ask(&[
            0x53,
            address << 1,
            0x01,
            0x50,
            0x53,
            address << 1 | 1,
            0x10,
            0x50,
        ]);
        assert_eq!(id.len(), 16);
        ids.insert(id);
    }
    assert_eq!(ids.len(), 16);
}

#[test]
fn calibration_is_22_bytes_that_come_back_as_written() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    let data: Vec<u8> = (100..122).collect();
    for (start, part) in [(0x55, &data[..15]), (0x64, &data[15..])] {
        let mut message = vec![0x53, 0x50, part.len() as u8 + 1, start];
        message.extend_from_slice(part);
        message.push(0x50);
        bench.ask(&message);
    }
    let mut back = bench.ask(&[0x53, 0x50, 0x01, 0x55, 0x53, 0x51, 0x10, 0x50]);
    back.extend(bench.ask(&[0x53, 0x50, 0x01, 0x65, 0x53, 0x51, 0x06, 0x50]));
    assert_eq!(back, data);
}

#[test]
fn a_new_channel_connects_after_the_stop() {
    let mut bench = Bench::booted(flat);
    assert_eq!(
        bench.ask(&[0x53, 0xE1, 0x01, 0x50]),
        [0x00],
        "power-up value"
    );
    // Select and read in one message: the sensor is not there yet.
    let both = [0x53, 0xE0, 0x01, 0x01, 0x53, 0x51, 0x01, 0x50];
    assert_eq!(bench.ask(&both), []);
    assert_eq!(bench.ask(&STATUS), [0xF1]);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x01, 0x50]), [0xA0]);
    assert_eq!(bench.ask(&[0x53, 0xE1, 0x01, 0x50]), [0x01]);
}

#[test]
fn segment_s_is_sensor_s_on_channel_s_half() {
    // Index finger's PIP joint at 90 degrees: index_middle (5) and index_distal (6) turn about x.
    let mut bench = Bench::booted(|_| {
        let mut angles = [0.0; 25];
        angles[8] = core::f32::consts::FRAC_PI_2;
        angles
    });
    for sensor in 0..16u8 {
        let address = 0x28 + sensor % 2;
        bench.ask(&[0x53, 0xE0, 0x01, 1 << (sensor / 2), 0x50]);
        bench.start_fusion(address);
        // cos 45 deg * 2^14 = 11,585.
        let turned = matches!(sensor, 5 | 6);
        let expected = if turned {
            [11_585, 11_585, 0, 0]
        } else {
            [16_384, 0, 0, 0]
        };
        assert_eq!(bench.quaternion(address), expected, "sensor {sensor}");
    }
}

#[test]
fn fusion_output_is_new_every_10_ms_and_follows_the_pose_of_its_moment() {
    // One degree every 10 ms about x at the index MCP joint.
    let mut bench = Bench::booted(|t| {
        let mut angles = [0.0; 25];
        angles[5] = (t as f32 * 100.0).to_radians();
        angles
    });
    bench.ask(&[0x53, 0xE0, 0x01, 0x04, 0x50]);
    bench.start_fusion(0x28);
    let mut values = Vec::new();
    let start = bench.clock.now().as_ticks();
    for _ in 0..100 {
        values.push(bench.quaternion(0x28));
        bench.wait_ms(1);
    }
    values.dedup();
    let outputs = (bench.clock.now().as_ticks() - start) / 10_000;
    assert!(
        (values.len() as u64).abs_diff(outputs) <= 1,
        "{} in {outputs}",
        values.len()
    );
    let degrees = |q: [i16; 4]| 2.0 * f64::from(q[1]).atan2(f64::from(q[0])).to_degrees();
    for pair in values.windows(2) {
        let step = degrees(pair[1]) - degrees(pair[0]);
        assert!((step - 1.0).abs() < 0.02, "{step}");
    }
    let gyro = bench.ask(&[0x53, 0x50, 0x01, 0x14, 0x53, 0x51, 0x06, 0x50]);
    let rate = i16::from_le_bytes([gyro[0], gyro[1]]);
    assert!(
        (i32::from(rate) - 1_600).abs() <= 4,
        "100 deg/s is 1,600 counts, got {rate}"
    );
}

#[test]
fn the_answer_comes_after_uart_time_and_i2c_time() {
    for (baud, clock) in [(115_200u32, 0x05u8), (460_800, 0x05), (460_800, 0x13)] {
        let mut bench = Bench::with(Config::at_baud(baud), flat);
        bench.clock.set(Instant::from_ticks(700_000));
        bench.ask(&[0x57, 0x07, clock, 0x08, clock, 0x50]);
        bench.ask(&CHANNEL_0);
        let start = bench.clock.now().as_ticks();
        bench.send(&QUATERNION_29);
        while bench.drain().len() < 8 {
            // Nothing is half there: the burst ends at one moment.
            let event = bench.clock.next_event().expect("an answer");
            bench.clock.set(event);
        }
        let took = (bench.clock.now().as_ticks() - start) as f64;
        // 16 characters; start + address, pointer, start + address, 8 data: 101 bits and the stop.
        let uart = 16.0 * 10.0e6 / f64::from(baud);
        let i2c = 102.0 * f64::from(4 * u32::from(clock)) / 7.3728;
        assert!(
            (took - uart - i2c).abs() < 5.0,
            "{took} us, computed {}",
            uart + i2c
        );
    }
}

#[test]
fn a_scan_takes_the_time_computed_from_its_bytes() {
    for (baud, expected_ms) in [(115_200, 30.6), (230_400, 17.7), (460_800, 11.3)] {
        let mut bench = Bench::with(Config::at_baud(baud), flat);
        bench.clock.set(Instant::from_ticks(700_000));
        bench.ask(&[0x57, 0x07, 0x05, 0x08, 0x05, 0x50]);
        let start = bench.clock.now().as_ticks();
        for channel in 0..8 {
            bench.ask(&[0x53, 0xE0, 0x01, 1 << channel, 0x50]);
            assert_eq!(bench.ask(&QUATERNION_29).len(), 8);
            assert_eq!(
                bench
                    .ask(&[0x53, 0x50, 0x01, 0x20, 0x53, 0x51, 0x08, 0x50])
                    .len(),
                8
            );
        }
        let took_ms = (bench.clock.now().as_ticks() - start) as f64 / 1e3;
        assert!(
            (took_ms - expected_ms).abs() < 0.1,
            "{took_ms} ms at {baud}"
        );
    }
}

#[test]
fn more_than_16_data_bytes_do_nothing() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x11, 0x50]), []);
    let mut long = vec![0x53, 0x50, 0x11, 0x55];
    long.extend([0x77; 16]);
    long.push(0x50);
    bench.ask(&long);
    assert_eq!(bench.glove.counters().refusals, 2);
    assert_eq!(bench.glove.sensor_register(0, 0, 0x55), 0);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x10, 0x50]).len(), 16);
}

#[test]
fn half_a_message_is_forgotten_after_the_idle_timeout() {
    let mut bench = Bench::booted(flat);
    bench.send(&[0x53, 0x50, 0x0A, 0x20]);
    bench.wait_ms(600);
    assert_eq!(bench.ask(&STATUS), [], "taken for data");
    bench.wait_ms(660);
    assert_eq!(bench.ask(&STATUS), [0xF0]);
}

#[test]
fn faults_show_on_the_wire_as_hardware_shows_them() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    bench.start_fusion(0x28);
    bench.start_fusion(0x29);
    let glove = bench.glove.clone();

    glove.flip_bit15(1, 0, 1);
    assert_eq!(bench.quaternion(0x29), [-16_384, 0, 0, 0]);
    assert_eq!(bench.quaternion(0x29), [16_384, 0, 0, 0]);

    glove.reset_in_read(1);
    assert_eq!(bench.ask(&QUATERNION_29)[..4], [0xA0, 0xFB, 0x32, 0x0F]);
    assert_eq!(bench.quaternion(0x29), [0; 4], "back in CONFIG");
    assert_eq!(bench.quaternion(0x28), [16_384, 0, 0, 0]);

    glove.nack(1, 1);
    assert_eq!(bench.ask(&QUATERNION_29), []);
    assert_eq!(bench.ask(&STATUS), [0xF1]);
    assert_eq!(bench.ask(&QUATERNION_29).len(), 8);

    glove.unplug(0, true);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x08, 0x50]), []);
    glove.unplug(0, false);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x08, 0x50]).len(), 8);

    glove.cut_answers(3, 1);
    assert_eq!(bench.ask(&QUATERNION_29).len(), 3);

    glove.unplug_mux(true);
    assert_eq!(bench.ask(&CHANNEL_0), []);
    assert_eq!(bench.ask(&STATUS), [0xF1]);
    glove.unplug_mux(false);

    glove.reset_mux();
    assert_eq!(bench.ask(&QUATERNION_29), []);

    glove.reset_sensor(0, bench.clock.now());
    bench.ask(&CHANNEL_0);
    assert_eq!(bench.ask(&[0x53, 0x51, 0x01, 0x50]), []);
}

#[test]
fn a_dead_bus_ends_by_the_bridges_timeout_or_not_at_all() {
    let mut bench = Bench::booted(flat);
    // Enabled, 5 steps of 4.44 ms.
    bench.ask(&[0x57, 0x09, 5 << 1 | 1, 0x50]);
    bench.glove.dead_bus(true);
    let before = bench.clock.now().as_ticks();
    assert_eq!(bench.ask(&CHANNEL_0), []);
    let took = bench.clock.now().as_ticks() - before;
    assert!((22_200..22_500).contains(&took), "{took}");
    assert_eq!(bench.ask(&STATUS), [0xF8]);
    bench.ask(&[0x57, 0x09, 0x00, 0x50]);
    bench.ask(&CHANNEL_0);
    bench.wait_ms(1_000);
    assert_eq!(bench.ask(&STATUS), [], "hangs for as long as the bus does");
    bench.glove.dead_bus(false);
    bench.wait_ms(700);
    assert_eq!(bench.ask(&STATUS).last(), Some(&0xF1));
}

#[test]
fn stretching_costs_time_and_trips_the_timeout() {
    let mut bench = Bench::booted(flat);
    bench.ask(&CHANNEL_0);
    let time = |bench: &mut Bench| {
        let before = bench.clock.now().as_ticks();
        let count = bench.ask(&QUATERNION_29).len();
        (count, bench.clock.now().as_ticks() - before)
    };
    let (count, plain) = time(&mut bench);
    bench.glove.stretch(1, Duration::from_micros(180));
    let (stretched_count, stretched) = time(&mut bench);
    assert_eq!((count, stretched_count), (8, 8));
    // Nine data bytes: the pointer and eight.
    assert_eq!(stretched - plain, 9 * 180);
    bench.ask(&[0x57, 0x09, 1 << 1 | 1, 0x50]);
    bench.glove.stretch(1, Duration::from_millis(5));
    assert_eq!(bench.ask(&QUATERNION_29), []);
    assert_eq!(bench.ask(&STATUS), [0xF8]);
}

#[test]
fn a_still_hand_dithers_by_one_count_and_a_frozen_sensor_does_not() {
    let mut bench = Bench::with(Config::at_baud(460_800), flat);
    bench.clock.set(Instant::from_ticks(700_000));
    bench.ask(&CHANNEL_0);
    bench.start_fusion(0x28);
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..50 {
        let q = bench.quaternion(0x28);
        assert!(
            (q[0] - 16_384).abs() <= 1 && q[1..].iter().all(|c| c.abs() <= 1),
            "{q:?}"
        );
        seen.insert(q);
        bench.wait_ms(10);
    }
    assert!(seen.len() > 20, "{}", seen.len());
    bench.glove.freeze(0, true);
    let stuck = bench.quaternion(0x28);
    for _ in 0..20 {
        bench.wait_ms(10);
        assert_eq!(bench.quaternion(0x28), stuck);
    }
}

#[test]
fn mounting_turns_what_a_sensor_reports() {
    let half = core::f32::consts::FRAC_1_SQRT_2;
    let mut config = Config {
        dither: None,
        ..Config::at_baud(460_800)
    };
    config.mounting[0] = [half, 0.0, half, 0.0];
    config.world = [half, 0.0, 0.0, half];
    let mut bench = Bench::with(config, flat);
    bench.clock.set(Instant::from_ticks(700_000));
    bench.ask(&CHANNEL_0);
    bench.start_fusion(0x28);
    // Rz(90) Ry(90) = (1/2)(1, -1, 1, 1).
    assert_eq!(bench.quaternion(0x28), [8_192, -8_192, 8_192, 8_192]);
    // A heading of -90 degrees takes the world's turn away: Ry(90) is left.
    bench.glove.set_heading(0, -core::f32::consts::FRAC_PI_2);
    bench.wait_ms(10);
    assert_eq!(bench.quaternion(0x28), [11_585, 0, 11_585, 0]);
}

#[test]
fn random_bytes_never_break_it() {
    for seed in 0..40 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut bench = Bench::booted(flat);
        for _ in 0..60 {
            let mut noise = vec![0; (rng.next_u32() % 64) as usize];
            rng.fill_bytes(&mut noise);
            // Letters that mean something, more often than by chance.
            for byte in noise.iter_mut().filter(|b| **b < 100) {
                *byte = b"SPRWIOZ\x50\x51\x01"[usize::from(*byte % 10)];
            }
            // A baud change would only make the rest noise.
            noise.retain(|b| *b != b'W' || seed % 2 == 0);
            bench.send(&noise);
            bench.wait_ms(u64::from(rng.next_u32() % 30));
        }
        // The noise may have chosen a baud of 112.
        bench.wait_ms(1_000_000);
        bench.glove.reset_bridge(bench.clock.now());
        bench.wire.set_baud(9_600);
        bench.wait_ms(1_000);
        assert!(bench.drain().ends_with(b"OK"));
        assert_eq!(bench.ask(&STATUS), [0xF0]);
    }
}
