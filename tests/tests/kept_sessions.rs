//! Sessions that were kept: what a log holds gives the same commands again, and a damaged log what is left of it.
#![allow(missing_docs)]

use host::recording::traced::Traced;
use host::replay::{self, Changes};
use host::session::Driving;
use loop_tests::images;
use loop_tests::sessions::{Log, replayed};

#[test]
fn seeded_sessions_with_faults_replay_from_their_logs_with_no_other_byte_or_state() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut followed, mut stopped) = (0, 0);
    let mut acts = [0; 3];
    // Three whose trace is written at their end, and five that a log's writer follows.
    let after = (1..=3).map(|seed| (seed, Log::After));
    for (seed, log) in after.chain((4..=8).map(|seed| (seed, Log::Live))) {
        let session = replayed(seed, 15, &folder.path().join(format!("{seed}.mcap")), log);
        println!("seed {seed}, {log:?}: {session:?}");
        assert_eq!(session.same.difference, None, "seed {seed}");
        assert_eq!(session.same.cut, None, "seed {seed}");
        assert!(session.same.time_us > 26_000_000 && session.same.written[1] > 10_000);
        assert!(session.events > 5, "seed {seed}");
        followed += session.followed;
        stopped += session.stopped;
        if log == Log::Live {
            let now = session.acts;
            let now = [now.engaged, now.released, now.settings];
            acts = core::array::from_fn(|k| acts[k] + now[k]);
        }
    }
    assert!(followed > 100 && stopped > 0, "{followed} {stopped}");
    // The person let go and changed settings in those that were written live, too.
    assert!(acts.iter().all(|acts| *acts > 0), "{acts:?}");
}

#[test]
fn a_log_cut_anywhere_or_with_a_flipped_bit_is_replayed_as_far_as_it_goes() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole.mcap");
    let path = folder.path().join("damaged.mcap");
    let session = replayed(9, 2, &whole, Log::Live);
    assert_eq!((session.same.difference, session.same.cut), (None, None));
    let bytes = std::fs::read(&whole).expect("a log");
    let mut read = 0;
    for cut in (0..bytes.len()).step_by(bytes.len() / 40 + 1) {
        std::fs::write(&path, &bytes[..cut]).expect("room");
        let Ok(traced) = Traced::read(&path) else {
            continue;
        };
        read += 1;
        assert!(!traced.found.finished && !traced.found.damage.is_empty() || cut > bytes.len() / 2);
        let same = replay::same(&traced, &mut ()).expect("a bridge");
        assert_eq!(same.difference, None, "cut at {cut}");
    }
    for place in (100..bytes.len()).step_by(bytes.len() / 40 + 1) {
        let mut flipped = bytes.clone();
        flipped[place] ^= 1 << (place % 8);
        std::fs::write(&path, &flipped).expect("room");
        let Ok(traced) = Traced::read(&path) else {
            continue;
        };
        assert!(!traced.found.damage.is_empty(), "bit at {place}: not named");
        let same = replay::same(&traced, &mut ()).expect("a bridge");
        assert_eq!(same.difference, None, "bit at {place}");
    }
    println!("{} bytes, {read} cuts could be replayed", bytes.len());
}

#[test]
fn another_map_or_setting_is_compared_frame_by_frame_and_the_same_one_differs_in_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |seed: u64| folder.path().join(format!("{seed}.mcap"));
    // One in which the gripper followed the hand for some time.
    let followed = |seed: &u64| replayed(*seed, 12, &place(*seed), Log::After).followed > 50;
    let seed = (1..=6).find(followed).expect("none of six followed");
    let path = place(seed);
    let traced = Traced::read(&path).expect("a log");
    let compared = |changes: &Changes| {
        let compared = replay::compare(&traced, changes, &mut ()).expect("two bridges");
        println!("{compared:?}");
        assert!(compared.frames > 200 && compared.output.frames > 100);
        compared
    };
    let same = compared(&Changes::default());
    assert_eq!((same.output.max, same.output.one_sided), (0.0, 0));
    let image = Some(images::gentle(6));
    let map = compared(&Changes {
        image,
        ..Changes::default()
    });
    assert!(map.output.max > 1.0 && map.output.mean > 0.0 && map.output.mean < map.output.max);
    assert!(map.output.max_axis < 4 && map.output.max_at_us <= traced.end);
    // A slower gripper is told something else by the same map.
    let driving = Driving {
        rate: Some(20.0),
        ..Driving::default()
    };
    let slow = compared(&Changes {
        driving,
        ..Changes::default()
    });
    assert_eq!((slow.output.max, slow.output.one_sided), (0.0, 0));
    assert!(slow.command.max > same.command.max, "{same:?}");
}
