//! The host protocol: frames, sessions, weights over the line, refusals.

mod common;

use bridge::calibration::{Refusal as NotTaken, Try};
use bridge::protocol::message::{
    Answer, CHUNK, Call, Devices, FromBridge, Refusal, Sample, SensorIds, SlotContents,
    UnusedSensor, VERSION, WeightsKind,
};
use bridge::protocol::{Outcome, frame};
use bridge::telemetry::ALL_JOINTS;
use bridge::{Settings, State, store};
use common::bench::{Bench, MS, S};
use common::host::{Host, crc32, framed};
use common::wearer::Wearer;
use common::{Flash, hand_image, hand_image_int16};
use glove::calibration::Bound;
use glove::scan::Health;
use rig::flash::Power;
use rig::person::Task;

fn without_weights() -> Host {
    Host::new(Bench::with(
        Settings::default(),
        None,
        rig::gripper::Config::default(),
    ))
}

fn following() -> Host {
    let mut bench = Bench::new(Settings::default());
    bench.ready();
    let mut host = Host::new(bench).hello();
    for _ in 0..30 {
        host.ask(Call::Engage).expect("taken");
        host.run(100 * MS);
    }
    assert_eq!(host.bench.state(), State::Following);
    host
}

#[test]
fn hello_and_status_have_the_bytes_that_the_protocol_document_prints() {
    let mut host = without_weights();
    host.say(&[0x08, 0x07, 0x01, 0x00]); // noise, then a zero ends it
    host.say(&framed(&[0x07, 0x01, 0x00, 0x03]));
    let reply = host.reply();
    assert_eq!((reply.session, reply.sequence), (7, 1));
    let Ok(Answer::Hello(hello)) = reply.answer else {
        panic!("{reply:?}")
    };
    assert_eq!(hello.version, 3);
    assert_eq!(hello.shape, [25, 300, 4]);
    assert_eq!(hello.joint_order, 1);
    host.say(&framed(&[0x07, 0x02, 0x01]));
    assert!(matches!(host.reply().answer, Ok(Answer::Status(_))));
}

#[test]
fn another_version_and_requests_before_hello_are_refused() {
    let mut host = without_weights();
    assert_eq!(host.ask(Call::Status), Err(Refusal::NoSession));
    let answer = host.ask(Call::Hello { version: 1 });
    assert_eq!(answer, Err(Refusal::Version { bridge: 3 }));
    assert_eq!(host.ask(Call::Engage), Err(Refusal::NoSession));
    assert!(!host.bench.app.is_engaged());
}

#[test]
fn an_image_flashed_over_the_line_is_the_map_and_reads_back_by_its_crc() {
    let mut host = without_weights().hello();
    let image = hand_image(5);
    let Ok(Answer::Slots(slots)) = host.flash(&image) else {
        panic!()
    };
    let active = usize::from(slots.active.unwrap());
    let SlotContents::Image {
        version,
        length,
        crc,
        ..
    } = slots.contents[active]
    else {
        panic!()
    };
    assert_eq!(
        (version, length, crc),
        (5, image.len() as u32, crc32(&image))
    );
    assert_eq!(
        host.bench.app.store().active_bytes().unwrap()[..image.len()],
        image[..]
    );
}

#[test]
fn both_slots_are_told_each_with_the_crc_and_the_kind_of_its_own_image() {
    let mut host = without_weights().hello();
    let images = [hand_image(1), hand_image_int16(2)];
    for image in &images {
        assert!(host.flash(image).is_ok());
    }
    let Ok(Answer::Slots(slots)) = host.ask(Call::Slots) else {
        panic!()
    };
    let told = slots.contents.map(|contents| match contents {
        SlotContents::Image { crc, weights, .. } => (crc, weights),
        other => panic!("{other:?}"),
    });
    let kinds = [WeightsKind::Float32, WeightsKind::Int16];
    assert_eq!(
        told,
        [(crc32(&images[0]), kinds[0]), (crc32(&images[1]), kinds[1])]
    );
}

#[test]
fn a_broken_transfer_goes_on_where_it_stopped_for_the_same_image_only() {
    let mut host = without_weights().hello();
    let image = hand_image(1);
    host.begin(&image);
    host.chunks(&image, 0, 8 * CHUNK);
    host.run(3 * S); // the host is gone for longer than its lease
    assert_eq!(host.ask(Call::Status), Err(Refusal::NoSession));
    let mut host = host.hello();
    assert_eq!(host.begin(&image), 8 * CHUNK as u32);
    host.chunks(&image, 8 * CHUNK, image.len());
    assert!(host.ask(Call::WeightsCommit).is_ok());

    let other = hand_image(2);
    host.begin(&other);
    host.chunks(&other, 0, 4 * CHUNK);
    let third = hand_image(3);
    assert_eq!(
        host.begin(&third),
        0,
        "another image of the same length starts anew"
    );
}

#[test]
fn a_request_that_comes_twice_is_done_once_and_answered_twice() {
    let mut host = without_weights().hello();
    let image = hand_image(1);
    host.begin(&image);
    host.chunks(&image, 0, image.len());
    host.send(7, 900, Call::WeightsCommit);
    let first = host.reply();
    host.send(7, 900, Call::WeightsCommit);
    assert_eq!(host.reply(), first);
    assert!(first.answer.is_ok());
}

#[test]
fn while_the_clutch_is_closed_weights_configuration_and_restart_are_refused() {
    let mut host = following();
    let image = hand_image(9);
    let begun = host.ask(Call::WeightsBegin {
        length: image.len() as u32,
        crc: crc32(&image),
    });
    assert_eq!(begun, Err(Refusal::Store(store::Error::Engaged)));
    let Ok(Answer::Configuration(configuration)) = host.ask(Call::ConfigurationGet) else {
        panic!()
    };
    assert_eq!(
        host.ask(Call::ConfigurationSet(configuration)),
        Err(Refusal::Engaged)
    );
    assert_eq!(host.ask(Call::Reboot), Err(Refusal::Engaged));
    assert_eq!(host.ask(Call::Activate), Err(Refusal::Engaged));
    assert_eq!(host.outcome, Outcome::Continue);
}

#[test]
fn the_clutch_opens_when_its_heartbeat_stops() {
    let mut host = following();
    host.run(300 * MS);
    assert!(
        matches!(host.bench.state(), State::Holding(_)),
        "{:?}",
        host.bench.state()
    );
}

#[test]
fn the_hold_that_a_vanished_host_leaves_is_told_and_ends_by_a_release() {
    let mut host = following();
    let clutch = |host: &mut Host| match host.ask(Call::Status) {
        Ok(Answer::Status(status)) => (status.engaged, status.heartbeat),
        other => panic!("{other:?}"),
    };
    assert_eq!(clutch(&mut host), (true, true));
    host.run(5 * S);
    let mut host = host.hello();
    assert_eq!(clutch(&mut host), (true, false));
    let held = host.bench.gripper.positions();
    assert_eq!(
        host.ask(Call::ConfigurationGet).map(|_| ()),
        Ok(()),
        "asking is free"
    );
    assert_eq!(host.ask(Call::Activate), Err(Refusal::Engaged));
    assert!(host.ask(Call::Release).is_ok());
    host.run(100 * MS);
    assert_eq!(clutch(&mut host), (false, false));
    assert!(matches!(host.flash(&hand_image(2)), Ok(Answer::Slots(_))));
    let moved = held
        .iter()
        .zip(host.bench.gripper.positions())
        .any(|(held, now)| (held - now).abs() > 1.0);
    assert!(!moved, "a release moves nothing");
}

#[test]
fn a_second_host_is_refused_while_the_first_holds_the_clutch_and_taken_when_it_vanished() {
    let mut host = following();
    let busy = host.ask_as(8, Call::Hello { version: VERSION });
    assert_eq!(busy, Err(Refusal::Busy { session: 7 }));
    host.run(4 * S);
    assert!(host.ask_as(8, Call::Hello { version: VERSION }).is_ok());
    assert_eq!(host.ask_as(7, Call::Engage), Err(Refusal::NoSession));
}

#[test]
fn a_setting_out_of_range_is_refused_by_name_and_changes_nothing() {
    let mut host = without_weights().hello();
    let Ok(Answer::Configuration(before)) = host.ask(Call::ConfigurationGet) else {
        panic!()
    };
    let mut wrong = before.clone();
    wrong.lead = 41;
    let refused = host.ask(Call::ConfigurationSet(wrong));
    let Err(Refusal::Configuration {
        key,
        value,
        least,
        greatest,
    }) = refused
    else {
        panic!("{refused:?}")
    };
    assert_eq!(
        bridge::protocol::message::SETTING_NAMES[usize::from(key)],
        "lead"
    );
    assert_eq!((value, least, greatest), (41.0, 5.0, 40.0));
    assert_eq!(
        host.ask(Call::ConfigurationGet),
        Ok(Answer::Configuration(before.clone()))
    );
    let mut right = before;
    right.lead = 30;
    assert_eq!(
        host.ask(Call::ConfigurationSet(right.clone())),
        Ok(Answer::Configuration(right))
    );
}

#[test]
fn telemetry_comes_at_its_period_until_it_is_turned_off() {
    let mut host = without_weights().hello();
    assert_eq!(
        host.ask(Call::Telemetry { period_ms: 5 }),
        Err(Refusal::Period { least_ms: 20 })
    );
    host.ask(Call::Telemetry { period_ms: 50 }).unwrap();
    let mut samples = 0;
    for _ in 0..10 {
        host.run(100 * MS);
        while let Some(message) = host.hear() {
            samples += u32::from(matches!(message, FromBridge::Sample(_)));
        }
    }
    assert!((18..=21).contains(&samples), "{samples}");
    host.ask(Call::Telemetry { period_ms: 0 }).unwrap();
    host.run(500 * MS);
    assert_eq!(host.hear(), None);
}

/// The newest telemetry sample of the next 300 ms.
fn sample(host: &mut Host) -> Sample {
    host.ask(Call::Telemetry { period_ms: 50 }).expect("taken");
    host.run(300 * MS);
    let mut newest = None;
    while let Some(message) = host.hear() {
        if let FromBridge::Sample(sample) = message {
            newest = Some(sample);
        }
    }
    newest.expect("a sample")
}

#[test]
fn a_sample_says_whether_its_angles_are_a_calibrated_hands_and_which_of_them_are_old() {
    let mut host = without_weights();
    host.run(3 * S);
    let mut host = host.hello();
    let uncalibrated = sample(&mut host);
    let telemetry = host.bench.app.telemetry();
    assert!(telemetry.frame_sequence > 0 && telemetry.gives_angles);
    assert!(!telemetry.angles_valid && !telemetry.calibration.is_calibrated);
    assert_eq!(uncalibrated.not_shown, Some(ALL_JOINTS));
    let mut host = following();
    assert_eq!(sample(&mut host).not_shown, Some(0));
    host.bench.glove.unplug(7, true);
    host.run(500 * MS);
    let held = glove::hand::joints_of_segment(7);
    let beside_a_lost_sensor = sample(&mut host);
    assert_eq!(beside_a_lost_sensor.not_shown, Some(held));
    assert_eq!(beside_a_lost_sensor.is_valid(), Some(true));
    assert_eq!(beside_a_lost_sensor.is_whole(), Some(false));
    // Its heading is another: nothing is known of the hand.
    host.bench
        .glove
        .set_heading(0, core::f32::consts::FRAC_PI_2);
    host.run(S);
    assert_eq!(sample(&mut host).not_shown, Some(ALL_JOINTS));
}

fn devices(host: &mut Host) -> Devices {
    match host.ask(Call::Devices) {
        Ok(Answer::Devices(devices)) => devices,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_chip_names_its_sensors_one_by_one_and_tells_how_old_things_are_and_how_replies_came() {
    let mut host = following();
    let calm = devices(&mut host);
    assert_eq!(
        (&calm.sensors[..], calm.distrusted, calm.impossible),
        (&[][..], 0, 0)
    );
    assert!(calm.glove_age_ms.expect("frames come") < 60, "{calm:?}");
    let gripper = calm.gripper.expect("it answers");
    assert!(gripper.age_ms < 30 && gripper.going_to && gripper.axes.len() == 4);
    assert!(
        calm.replies.right > 100 && calm.replies.late == 0,
        "{:?}",
        calm.replies
    );
    host.bench.glove.unplug(7, true);
    host.bench
        .glove
        .set_heading(4, core::f32::consts::FRAC_PI_2);
    host.bench.gripper.mute(5);
    host.run(S);
    let told = devices(&mut host);
    let [
        UnusedSensor {
            segment: 7,
            health: Health::Missing(_),
        },
    ] = told.sensors[..]
    else {
        panic!("{:?}", told.sensors)
    };
    assert_eq!(told.distrusted, 1 << 4);
    assert_eq!(told.replies.missed - calm.replies.missed, 5);
    host.bench.gripper.mute(u32::MAX);
    (0..16).for_each(|k| host.bench.glove.unplug(k, true));
    host.run(700 * MS);
    let gone = devices(&mut host);
    assert!(gone.gripper.expect("known").age_ms >= 680);
    assert!(gone.glove_age_ms.expect("known") >= 650);
    assert_eq!((gone.missing, gone.sensors.len()), (0xFFFF, 3));
}

#[test]
fn a_restart_comes_after_its_reply() {
    let mut host = without_weights().hello();
    assert_eq!(host.ask(Call::Reboot), Ok(Answer::Done));
    host.run(50 * MS);
    assert_eq!(host.outcome, Outcome::Reboot);
}

#[test]
fn garbage_between_requests_is_counted_and_the_next_request_is_answered() {
    let mut host = without_weights().hello();
    let mut state = 0x1234_5678_u32;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    for round in 0..500 {
        let noise: Vec<u8> = (0..random() % 900).map(|_| random() as u8).collect();
        host.say(&noise);
        host.say(&[0]);
        assert!(host.ask(Call::Status).is_ok(), "round {round}");
    }
    let counters = host.counters();
    println!(
        "host frames good/crc/coding/oversized {:?}",
        counters.host_frames
    );
    assert!(counters.host_frames[1] + counters.host_frames[2] > 100);
    host.say(&vec![0x55; 3 * frame::MAX_FRAME]);
    host.say(&[0]);
    assert!(host.counters().host_frames[3] > 0);
}

#[test]
fn every_single_bit_error_in_a_request_is_refused_by_the_frame() {
    let frame = framed(&[0x07, 0x01, 0x00, 0x03]);
    for bit in 0..frame.len() * 8 {
        let mut host = without_weights();
        let mut damaged = frame.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        host.say(&damaged);
        host.say(&[0]);
        host.run(20 * MS);
        assert_eq!(host.hear(), None, "bit {bit}");
    }
}

/// A host at a bridge with an honest glove on a hand that lies flat, and a place for its profile.
fn wearing(wearer: &Wearer) -> Host {
    let (mut bench, _) = wearer.bench(&[(Task::Flat, 0.0)]);
    let power = Power::new();
    bench
        .app
        .keep_profile([Flash::new(64 * 1024, &power), Flash::new(64 * 1024, &power)]);
    bench.run(3 * S);
    Host::new(bench).hello()
}

fn give(host: &mut Host, profile: &Bound) -> Result<Answer, Refusal> {
    let bytes = profile.to_bytes();
    for (index, chunk) in bytes.chunks(CHUNK).enumerate() {
        let offset = (CHUNK * index) as u32;
        let there = offset + chunk.len() as u32;
        let answer = host.ask(Call::ProfileChunk {
            offset,
            bytes: chunk,
        });
        assert_eq!(answer, Ok(Answer::Received { bytes: there }));
    }
    host.ask(Call::ProfileCommit {
        length: bytes.len() as u32,
        crc: crc32(&bytes),
    })
}

/// A flat pose over the line: calibrated then, or why not.
fn flat_pose(host: &mut Host) -> Try {
    assert_eq!(host.ask(Call::CalibrateFlatHand), Ok(Answer::Done));
    loop {
        host.run(100 * MS);
        let Ok(Answer::Health(health)) = host.ask(Call::Health) else {
            panic!("no answer")
        };
        if health.calibration.newest != Try::Waiting {
            return health.calibration.newest;
        }
    }
}

#[test]
fn a_profile_over_the_line_is_kept_read_back_and_calibrated_by_a_flat_pose() {
    let wearer = Wearer::new(1);
    let profile = wearer.profile();
    let mut host = wearing(&wearer);
    let none = Refusal::Profile(store::profile::Error::NoProfile);
    assert_eq!(host.ask(Call::ProfileGet { offset: 0 }), Err(none));
    assert_eq!(flat_pose(&mut host), Try::Refused(NotTaken::NoProfile));
    assert_eq!(
        host.ask(Call::SensorIds),
        Ok(Answer::SensorIds(SensorIds(profile.ids.map(Some))))
    );
    assert_eq!(give(&mut host, &profile), Ok(Answer::Done));
    let mut back = Vec::new();
    while back.len() < Bound::BYTES {
        let offset = back.len() as u32;
        match host.ask(Call::ProfileGet { offset }) {
            Ok(Answer::Profile(part)) => back.extend_from_slice(&part.bytes),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(Bound::from_bytes(&back), Ok(profile));
    host.run(100 * MS);
    assert_eq!(flat_pose(&mut host), Try::Taken);
    let Ok(Answer::Headings(headings)) = host.ask(Call::Headings) else {
        panic!("no answer")
    };
    assert!(headings.profile.is_there && headings.profile.fits);
    assert_eq!((headings.unknown, headings.poses), (0, 1));
    assert!(headings.pose.is_some());
    host.ask(Call::Engage).expect("taken");
    assert_eq!(give_refused(&mut host, &profile), Err(Refusal::Engaged));
    assert_eq!(host.ask(Call::ProfileErase), Err(Refusal::Engaged));
    host.ask(Call::Release).expect("obeyed");
    host.run(100 * MS);
    assert_eq!(host.ask(Call::ProfileErase), Ok(Answer::Done));
    assert_eq!(host.ask(Call::ProfileGet { offset: 0 }), Err(none));
    assert_eq!(flat_pose(&mut host), Try::Refused(NotTaken::NoProfile));
}

fn give_refused(host: &mut Host, profile: &Bound) -> Result<Answer, Refusal> {
    host.ask(Call::ProfileChunk {
        offset: 0,
        bytes: &profile.to_bytes()[..100],
    })
}

#[test]
fn scans_over_the_line_are_the_sensors_by_wire_and_end_with_the_session() {
    let mut wearer = Wearer::new(1);
    wearer.honest.seats.swap(8, 11);
    let profile = wearer.profile();
    let mut host = wearing(&wearer);
    assert_eq!(give(&mut host, &profile), Ok(Answer::Done));
    host.ask(Call::Scans { on: true }).expect("on");
    let (mut scans, begun) = (Vec::new(), host.bench.now());
    while host.bench.now() < begun + S {
        host.turn();
        if let Some(FromBridge::Scan(scan)) = host.hear() {
            scans.push(scan);
        }
    }
    assert!((33..40).contains(&scans.len()), "{}", scans.len());
    for pair in scans.windows(2) {
        assert_eq!(pair[1].sequence, pair[0].sequence + 1);
        assert_eq!(pair[1].good, 0xFFFF);
    }
    let newest = scans.last().expect("some").frame();
    for k in 0..16 {
        let at = newest.samples[k].stamp;
        let truth = host.bench.glove.true_orientation(k, at);
        let q = newest.samples[k].orientation;
        let dot = q.w * truth[0] + q.i * truth[1] + q.j * truth[2] + q.k * truth[3];
        let off = 2.0 * dot.abs().min(1.0).acos().to_degrees();
        assert!(off < 2.0, "sensor {k} is {off}° off");
    }
    assert!(newest.samples[15].stamp.as_ticks() - newest.samples[0].stamp.as_ticks() > 20_000);
    host.run(2_500 * MS);
    while host.hear().is_some() {}
    host.run(S);
    assert!(host.hear().is_none(), "nobody asks any more");
}
