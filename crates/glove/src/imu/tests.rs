use super::bringup::{BringUp, Next, Outcome, Step};
use super::*;
use crate::bus::{self, Batch, Bus, Direct, Transaction};
use crate::{Duration, Instant};
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction as Expect};

extern crate std;
use std::vec;

fn raw(counts: [i16; 4]) -> [u8; 8] {
    let mut bytes = [0; 8];
    for (pair, count) in bytes.chunks_mut(2).zip(counts) {
        pair.copy_from_slice(&count.to_le_bytes());
    }
    bytes
}

#[test]
fn eight_bytes_are_w_x_y_z_little_endian_in_counts_of_two_to_the_minus_14() {
    let q = orientation(&[0x00, 0x00, 0x00, 0x40, 0x00, 0x00, 0x00, 0x00]).unwrap();
    assert_eq!((q.w, q.i, q.j, q.k), (0.0, 1.0, 0.0, 0.0));
    // Half a turn less a bit: −0.6 and 0.8.
    let q = orientation(&raw([-9830, 0, 0, 13107])).unwrap();
    assert!((q.w + 0.6).abs() < 1e-4 && (q.k - 0.8).abs() < 1e-4);
}

#[test]
fn the_norm_may_be_off_by_two_percent_and_no_more() {
    assert!(orientation(&raw([16_384, 0, 0, 0])).is_ok());
    assert!(orientation(&raw([16_711, 0, 0, 0])).is_ok());
    assert!(orientation(&raw([0, 16_057, 0, 0])).is_ok());
    assert_eq!(orientation(&raw([16_713, 0, 0, 0])), Err(Fault::NotUnit));
    assert_eq!(orientation(&raw([0, 0, 16_055, 0])), Err(Fault::NotUnit));
    assert_eq!(orientation(&raw([i16::MIN; 4])), Err(Fault::NotUnit));
    assert_eq!(orientation(&raw([1, 0, 0, 0])), Err(Fault::NotUnit));
}

#[test]
fn a_flipped_bit_15_zeroes_and_the_chips_identification_are_told_apart() {
    // (0.5, 0.5, 0.5, 0.5) with bit 15 of one component flipped: the norm seen in the field, 1.40 to 2.20.
    let good = [0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20];
    assert!(orientation(&good).is_ok());
    for high in [1, 3, 5, 7] {
        let mut flipped = good;
        flipped[high] ^= 0x80;
        assert_eq!(orientation(&flipped), Err(Fault::NotUnit));
    }
    assert_eq!(orientation(&[0; 8]), Err(Fault::Zero));
    assert_eq!(
        orientation(&[0xA0, 0xFB, 0x32, 0x0F, 0x11, 0x03, 0x15, 0x00]),
        Err(Fault::Restarted)
    );
}

#[test]
fn every_eight_bytes_give_a_unit_quaternion_or_a_fault() {
    let mut state = 7u64;
    for _ in 0..100_000 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let bytes = (state ^ state >> 29).to_le_bytes();
        if let Ok(q) = orientation(&bytes) {
            assert!((q.norm() - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_step_faster_than_3000_degrees_a_second_is_out_of_reach() {
    let turned = |degrees: f32| {
        let half = degrees.to_radians() / 2.0;
        Quaternion::new_unchecked(nalgebra::Quaternion::new(
            libm::cosf(half),
            0.0,
            libm::sinf(half),
            0.0,
        ))
    };
    let still = Quaternion::identity();
    let ms = |n: u64| Duration::from_ticks(n * 1_000);
    assert!(is_reachable(&still, &turned(59.0), ms(20)));
    assert!(!is_reachable(&still, &turned(61.0), ms(20)));
    // Two reads close together may straddle one output of the fusion.
    assert!(is_reachable(&still, &turned(29.0), ms(1)));
    assert!(!is_reachable(&still, &turned(31.0), ms(1)));
    // q and −q are one orientation.
    let negated = Quaternion::new_unchecked(-turned(10.0).into_inner());
    assert!(is_reachable(&still, &negated, ms(20)));
    assert!(continuous(negated, &still).w > 0.0);
}

#[test]
fn sensors_sit_in_pairs_on_the_channels() {
    let places: std::vec::Vec<_> = (0..16).map(|k| (channel(k), address(k))).collect();
    assert_eq!(places[..4], [(0, 0x28), (0, 0x29), (1, 0x28), (1, 0x29)]);
    assert_eq!(places[15], (7, 0x29));
}

/// Runs one step against a blocking bus; also says how often it was asked.
fn run(step: Step, address: u8, bus: &mut Direct<Mock>) -> Result<Outcome, Error> {
    let mut bring_up = BringUp::new(step, address, Config::default());
    let now = Instant::from_ticks(0);
    for _ in 0..20 {
        match bring_up.next() {
            Next::Done(outcome) => return Ok(outcome),
            Next::Failed(error) => return Err(error),
            Next::Transaction(transaction) => {
                bus.start(&Batch::from_slice(&[transaction]).unwrap(), now)
                    .unwrap();
                let result = bus.poll(now).unwrap();
                bring_up.supply(result.as_deref().map_err(|e| *e));
            }
        }
    }
    panic!("a step without an end");
}

fn page(address: u8) -> Expect {
    Expect::write(address, vec![0x07, 0x00])
}

fn read(address: u8, register: u8, answer: u8) -> Expect {
    Expect::write_read(address, vec![register], vec![answer])
}

fn scripted(script: &[Expect]) -> Direct<Mock> {
    Direct::new(Mock::new(script))
}

fn pause(step: Step, micros: u64) -> Outcome {
    Outcome {
        next: Some(step),
        pause: Duration::from_ticks(micros),
        pointer_stays: None,
        unique_id: None,
    }
}

/// A unique id.
const UNIQUE: UniqueId = [3, 1, 4, 1, 5, 9, 2, 6, 5, 3, 5, 8, 9, 7, 9, 3];

/// It is read, twice.
fn unique(a: u8) -> [Expect; 5] {
    [
        Expect::write(a, vec![0x07, 0x01]),
        Expect::write_read(a, vec![0x50], UNIQUE.to_vec()),
        Expect::write_read(a, vec![0x50], UNIQUE.to_vec()),
        page(a),
        read(a, 0x07, 0x00),
    ]
}

#[test]
fn a_unique_id_that_reads_otherwise_the_second_time_or_is_none_names_nobody() {
    let a = 0x28;
    let mut flipped = UNIQUE;
    flipped[7] ^= 0x10;
    let identify = |first: UniqueId, second: UniqueId| {
        let mut bus = scripted(&[
            page(a),
            read(a, 0x00, 0xA0),
            Expect::write(a, vec![0x07, 0x01]),
            Expect::write_read(a, vec![0x50], first.to_vec()),
            Expect::write_read(a, vec![0x50], second.to_vec()),
            page(a),
            read(a, 0x07, 0x00),
        ]);
        let outcome = run(Step::Identify, a, &mut bus);
        bus.release().done();
        outcome
    };
    assert!(matches!(
        identify(UNIQUE, flipped),
        Err(Error::ReadBack { register: 0x50, .. })
    ));
    for none in [[0; 16], [0xFF; 16]] {
        assert_eq!(identify(none, none).unwrap().unique_id, None);
    }
}

#[test]
fn bring_up_makes_exactly_these_transactions() {
    let a = 0x28;
    let mut script = vec![
        // Identify: chip id, and the unique id twice from page 1.
        page(a),
        read(a, 0x00, 0xA0),
        Expect::write(a, vec![0x07, 0x01]),
        Expect::write_read(a, vec![0x50], UNIQUE.to_vec()),
        Expect::write_read(a, vec![0x50], UNIQUE.to_vec()),
        page(a),
        read(a, 0x07, 0x00),
        // Stop: CONFIG, because a running sensor does not take a reset.
        page(a),
        read(a, 0x3D, 0x0C),
        page(a),
        Expect::write(a, vec![0x3D, 0x00]),
        // Reset.
        page(a),
        Expect::write(a, vec![0x3F, 0x20]),
    ];
    script.extend(configure(a));
    // Verify: mode read back, unique id, system status, and once more without naming the register.
    script.extend([page(a), read(a, 0x3D, 0x08)]);
    script.extend(unique(a));
    script.extend([Expect::write_read(a, vec![0x39], vec![5, 0])]);
    script.push(Expect::read(a, vec![5, 0]));
    let mut bus = scripted(&script);
    let identified = Outcome {
        unique_id: Some(UNIQUE),
        ..pause(Step::Stop, 0)
    };
    assert_eq!(run(Step::Identify, a, &mut bus), Ok(identified));
    assert_eq!(run(Step::Stop, a, &mut bus), Ok(pause(Step::Reset, 20_000)));
    assert_eq!(
        run(Step::Reset, a, &mut bus),
        Ok(pause(Step::Configure, 650_000))
    );
    assert_eq!(
        run(Step::Configure, a, &mut bus),
        Ok(pause(Step::Verify, 10_000))
    );
    let up = Outcome {
        next: None,
        pause: Duration::from_ticks(0),
        pointer_stays: Some(true),
        unique_id: Some(UNIQUE),
    };
    assert_eq!(run(Step::Verify, a, &mut bus), Ok(up));
    bus.release().done();
}

/// Power mode, clock and units, read back; then IMU mode.
fn configure(a: u8) -> std::vec::Vec<Expect> {
    vec![
        page(a),
        read(a, 0x00, 0xA0),
        page(a),
        Expect::write(a, vec![0x3E, 0x00]),
        page(a),
        Expect::write(a, vec![0x3F, 0x00]),
        page(a),
        read(a, 0x3E, 0x00),
        Expect::write(a, vec![0x3B, 0x00]),
        read(a, 0x3B, 0x00),
        page(a),
        Expect::write(a, vec![0x3D, 0x08]),
    ]
}

#[test]
fn a_mode_write_that_failed_is_written_again_and_not_believed() {
    // The crate's cached mode would make the second try write nothing.
    let a = 0x29;
    let nack = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data);
    let mut script = configure(a);
    script.pop();
    script.push(Expect::write(a, vec![0x3D, 0x08]).with_error(nack));
    script.extend(configure(a));
    let mut bus = scripted(&script);
    let failed = Error::Bus {
        register: 0x3D,
        cause: bus::Error::NackData,
    };
    assert_eq!(run(Step::Configure, a, &mut bus), Err(failed));
    assert_eq!(
        run(Step::Configure, a, &mut bus),
        Ok(pause(Step::Verify, 10_000))
    );
    bus.release().done();
}

#[test]
fn what_is_wrong_at_bring_up_is_named() {
    let a = 0x28;
    let nack = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
    let mut bus = scripted(&[
        page(a).with_error(nack),
        page(a),
        read(a, 0x00, 0xFB),
        page(a),
        read(a, 0x3D, 0x00),
        page(a),
        read(a, 0x3D, 0x08),
        Expect::write(a, vec![0x07, 0x01]),
        Expect::write_read(a, vec![0x50], UNIQUE.to_vec()),
        Expect::write_read(a, vec![0x50], UNIQUE.to_vec()),
        page(a),
        read(a, 0x07, 0x00),
        Expect::write_read(a, vec![0x39], vec![1, 3]),
    ]);
    let absent = Error::Bus {
        register: 0x07,
        cause: bus::Error::NackAddress,
    };
    assert_eq!(run(Step::Identify, a, &mut bus), Err(absent));
    assert_eq!(run(Step::Identify, a, &mut bus), Err(Error::ChipId(0xFB)));
    let not_kept = Error::ReadBack {
        register: 0x3D,
        wrote: 0x08,
        read: 0x00,
    };
    assert_eq!(run(Step::Verify, a, &mut bus), Err(not_kept));
    assert_eq!(
        run(Step::Verify, a, &mut bus),
        Err(Error::NotRunning {
            status: 1,
            error: 3
        })
    );
    bus.release().done();
}

#[test]
fn a_register_pointer_that_runs_on_is_noticed() {
    let a = 0x29;
    let mut script = vec![page(a), read(a, 0x3D, 0x08)];
    script.extend(unique(a));
    script.extend([
        Expect::write_read(a, vec![0x39], vec![5, 0]),
        Expect::read(a, vec![0, 0]),
    ]);
    let mut bus = scripted(&script);
    assert_eq!(
        run(Step::Verify, a, &mut bus).unwrap().pointer_stays,
        Some(false)
    );
    bus.release().done();
}

#[test]
fn a_recheck_tells_a_glitch_from_a_restart() {
    let a = 0x28;
    let cases = [
        (0x08, None),
        (0x00, Some(Step::Configure)),
        (0x0C, Some(Step::Identify)),
    ];
    for (mode, next) in cases {
        let mut script = vec![page(a), read(a, 0x3D, mode)];
        let reads_id = next != Some(Step::Identify);
        script.extend(unique(a).into_iter().filter(|_| reads_id));
        let mut bus = scripted(&script);
        let outcome = run(Step::Recheck, a, &mut bus).unwrap();
        assert_eq!(outcome.next, next);
        assert_eq!(outcome.unique_id, reads_id.then_some(UNIQUE));
        bus.release().done();
    }
}

#[test]
fn a_step_asks_for_the_same_transaction_until_it_is_answered() {
    let bring_up = BringUp::new(Step::Reset, 0x28, Config::default());
    let wanted = Next::Transaction(Transaction::write(0x28, &[0x07, 0x00]).unwrap());
    assert_eq!(bring_up.next(), wanted);
    assert_eq!(bring_up.next(), wanted);
}
