use super::*;

fn lived(seed: u64) -> Lived {
    Lived {
        space: Space::ThreeFinger,
        rounds: 8,
        seed,
        nonsense: None,
        starts: None,
    }
}

fn never(_: &Teaching) -> bool {
    false
}

struct Bench {
    _folder: tempfile::TempDir,
    kept: Kept,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self {
            kept: Kept::beside(&folder.path().join("model.safetensors")),
            _folder: folder,
        }
    }
}

#[test]
fn a_whole_live_training_of_eight_rounds_ends_with_a_usable_map() {
    let (bench, mut lived) = (Bench::new(), lived(1));
    // One costs a minute less than as many as usual.
    lived.starts = Some(1);
    let mut body = Bare::new(&Wearer::new(1));
    lived.free_motion(&mut body, &bench.kept).unwrap();
    let (mut lessons, motion) = lived.lessons(&bench.kept).unwrap();
    let came = lived
        .poses(&mut body, &mut lessons, &bench.kept, &mut never)
        .unwrap();
    assert_eq!(came.pairs.len(), 10);
    assert_eq!(came.refused, 0);
    assert!(came.person_s < 60.0, "{}", came.person_s);
    let never = Interrupt::never().unwrap();
    let (_, judgement) = lived
        .finish(&mut lessons, &motion, &came.pairs, &never)
        .unwrap();
    let (most, median) = judgement.pairs.as_ref().unwrap().off();
    println!(
        "{judgement}; off the pairs by {most:.1}, {median:.1}; person {:.0} s",
        came.person_s
    );
    println!("{:#?}", judgement.influence.words());
    assert!(judgement.good(), "{judgement}");
    assert!(most <= 25.0 && median <= 8.0, "{most} {median}");
}

#[test]
fn a_session_that_is_killed_goes_on_with_every_pair_that_was_taken() {
    killed_at_moments(2, 2);
}

/// The motion is recorded once; a session is killed so often, each time at another moment, and goes on.
fn killed_at_moments(count: u64, seed: u64) {
    let (bench, lived) = (Bench::new(), lived(seed));
    let wearer = Wearer::new(seed);
    let mut body = Bare::new(&wearer);
    lived.free_motion(&mut body, &bench.kept).unwrap();
    let (mut whole, _) = lived.lessons(&bench.kept).unwrap();
    let mut random = host::trainer::random::Random::new(seed, 5);
    for moment in 0..count {
        let at = 2.0 + 40.0 * random.unit_f64();
        let _ = std::fs::remove_file(&bench.kept.pairs);
        let begun = seconds(body.now());
        let mut now = begun;
        let killed = lived.poses(&mut body, &mut whole, &bench.kept, &mut |_| {
            now += 0.028;
            now - begun > at
        });
        let taken = killed.unwrap().pairs;
        let left = match bench.kept.pairs.exists() {
            true => load_pairs(&bench.kept.pairs, &Aim::Gripper(lived.space)).unwrap(),
            false => Vec::new(),
        };
        // A pose that was just taken may not be in the file yet.
        let is_kept = taken.starts_with(&left) && taken.len() - left.len() <= 1;
        assert!(is_kept, "moment {moment}, {at:.1} s: {left:?} of {taken:?}");
        // Another program: nothing but the files is left.
        let (mut lessons, _) = lived.lessons(&bench.kept).unwrap();
        let came = lived
            .poses(&mut body, &mut lessons, &bench.kept, &mut never)
            .unwrap();
        assert_eq!(came.pairs.len(), 10, "moment {moment}");
        assert_eq!(came.pairs[..left.len()], left, "moment {moment}");
        // The pose that was asked next is the one that would have been.
        if left.len() > 2 && left.len() < 10 {
            let pairs = |to: usize| matrices(&came.pairs[2..to]);
            let start = matrices(&came.pairs[..2]);
            let next = whole
                .next(&start, &pairs(left.len()), &Default::default())
                .unwrap();
            assert_eq!(next.target.unwrap(), came.pairs[left.len()].target);
        }
    }
}

#[test]
fn one_axis_is_taught_with_the_same_words() {
    let (bench, mut lived) = (Bench::new(), lived(3));
    (lived.space, lived.rounds) = (Space::OneAxis, 2);
    let mut body = Bare::new(&Wearer::new(3));
    lived.free_motion(&mut body, &bench.kept).unwrap();
    let (mut lessons, _) = lived.lessons(&bench.kept).unwrap();
    let came = lived
        .poses(&mut body, &mut lessons, &bench.kept, &mut never)
        .unwrap();
    assert_eq!(came.pairs.len(), 4);
    assert!(came.pairs.iter().all(|pair| pair.target.len() == 1));
}

#[test]
#[ignore = "minutes: cargo xtask campaign teaching"]
fn fifty_killed_sessions_keep_every_pair() {
    killed_at_moments(50, 7);
}

#[test]
#[ignore = "minutes: cargo xtask campaign teaching"]
fn ten_persons_in_honest_gloves_teach_usable_maps() {
    let never_asked = Interrupt::never().unwrap();
    let (mut occupancy, mut most, mut median, mut machine) = (vec![], vec![], vec![], vec![]);
    for seed in 1..=10 {
        let (bench, lived, wearer) = (Bench::new(), lived(seed), Wearer::new(seed));
        let calibrated = wearer.calibrated(&never_asked).unwrap();
        let mut body = Gloved::new(&wearer, calibrated.bound()).unwrap();
        lived.free_motion(&mut body, &bench.kept).unwrap();
        let (mut lessons, motion) = lived.lessons(&bench.kept).unwrap();
        let came = lived
            .poses(&mut body, &mut lessons, &bench.kept, &mut never)
            .unwrap();
        let began = Here::now();
        let (finished, judgement) = lived
            .finish(&mut lessons, &motion, &came.pairs, &never_asked)
            .unwrap();
        let off = judgement.pairs.as_ref().unwrap().off();
        println!(
            "seed {seed}: person {:.0} s, refused {}, next pose {:.2} s, training {:.1} s, machine {:.1} s; off pairs {:.1} / {:.1}; {judgement}",
            came.person_s,
            came.refused,
            came.next_pose_s,
            finished.learned.took.as_secs_f64(),
            began.elapsed().as_secs_f64(),
            off.0,
            off.1
        );
        occupancy.push(judgement.quality.volume_occupancy);
        most.push(f64::from(off.0));
        median.push(f64::from(off.1));
        machine.push(began.elapsed().as_secs_f64());
    }
    for values in [&mut occupancy, &mut most, &mut median, &mut machine] {
        values.sort_by(f64::total_cmp);
    }
    println!(
        "occupancy {occupancy:.3?}\nmost {most:.1?}\nmedian {median:.1?}\nmachine {machine:.1?} s"
    );
    assert!(occupancy[5] >= 0.93, "{occupancy:?}");
    assert!(most[9] <= 25.0 && median[5] <= 8.0, "{most:?} {median:?}");
}

#[test]
#[ignore = "minutes: cargo xtask campaign teaching"]
fn a_nonsense_pair_of_eight_is_pointed_out() {
    let mut found = 0;
    for seed in 1..=10 {
        let (bench, mut lived, wearer) = (Bench::new(), lived(seed), Wearer::new(seed));
        lived.nonsense = Some(3 + (seed % 8) as usize);
        let mut body = Bare::new(&wearer);
        lived.free_motion(&mut body, &bench.kept).unwrap();
        let (mut lessons, _) = lived.lessons(&bench.kept).unwrap();
        let came = lived
            .poses(&mut body, &mut lessons, &bench.kept, &mut never)
            .unwrap();
        let said = host::training::judgement::pairs::suspect(&matrices(&came.pairs));
        println!(
            "seed {seed}: nonsense in {:?}, said {said:?}, refused {}",
            lived.nonsense, came.refused
        );
        let odd = host::training::judgement::pairs::Suspect::Odd(lived.nonsense.unwrap());
        found += u32::from(said == Some(odd));
    }
    assert!(found >= 9, "{found} of 10");
}
