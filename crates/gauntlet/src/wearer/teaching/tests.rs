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
fn a_session_that_stops_anywhere_goes_on_with_every_pair_that_was_taken() {
    stopped_at_moments(2, 2);
}

/// The motion is recorded once; a session stops so often, each time at another moment, and goes on with nothing but its files. The programs
/// that are killed: `killed.rs` of the whole loops.
fn stopped_at_moments(count: u64, seed: u64) {
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
        let stopped = lived.poses(&mut body, &mut whole, &bench.kept, &mut |_| {
            now += 0.028;
            now - begun > at
        });
        let taken = stopped.unwrap().pairs;
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
fn fifty_sessions_that_stop_anywhere_keep_every_pair() {
    stopped_at_moments(50, 7);
}

/// What came of one person, to be held against what teaching must reach.
struct Row {
    seed: u64,
    occupancy: f64,
    d_knn: f64,
    /// Greatest and median distance of the map from a reference pair, counts.
    off: (f64, f64),
    /// The person's time, and the program's own, processor seconds: all of it, and from a pose taken to the next one at most.
    person_s: f64,
    machine_s: f64,
    next_pose_s: f64,
    is_good: bool,
}

impl Row {
    fn of(seed: u64, never_asked: &Interrupt) -> Self {
        let (bench, lived, wearer) = (Bench::new(), lived(seed), Wearer::new(seed));
        let calibrated = wearer.calibrated(never_asked).unwrap();
        let mut body = Gloved::new(&wearer, calibrated.bound()).unwrap();
        lived.free_motion(&mut body, &bench.kept).unwrap();
        let (mut lessons, motion) = lived.lessons(&bench.kept).unwrap();
        let came = lived
            .poses(&mut body, &mut lessons, &bench.kept, &mut never)
            .unwrap();
        let began = worked();
        let (_, judgement) = lived
            .finish(&mut lessons, &motion, &came.pairs, never_asked)
            .unwrap();
        let (most, median) = judgement.pairs.as_ref().unwrap().off();
        let row = Self {
            seed,
            occupancy: judgement.quality.volume_occupancy,
            d_knn: judgement.quality.d_knn,
            off: (f64::from(most), f64::from(median)),
            person_s: came.person_s,
            machine_s: (worked() - began).as_secs_f64(),
            next_pose_s: came.next_pose_s,
            is_good: judgement.good(),
        };
        println!("{row}   {judgement}");
        row
    }
}

impl std::fmt::Display for Row {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "| {} | {:.3} | {:.1} | {:.1} | {:.1} | {:.0} | {:.1} | {:.2} |",
            self.seed,
            self.occupancy,
            self.d_knn,
            self.off.0,
            self.off.1,
            self.person_s,
            self.machine_s,
            self.next_pose_s
        )
    }
}

/// Of an even number the mean of the middle two.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() % 2 {
        0 => 0.5 * (values[middle - 1] + values[middle]),
        _ => values[middle],
    }
}

#[test]
fn the_median_of_an_even_number_lies_between_the_middle_two() {
    assert_eq!(median(vec![4.0, 1.0, 3.0, 2.0]), 2.5);
    assert_eq!(median(vec![4.0, 1.0, 3.0]), 3.0);
}

#[test]
#[ignore = "minutes: cargo xtask campaign teaching"]
fn ten_persons_in_honest_gloves_teach_usable_maps() {
    let never_asked = Interrupt::never().unwrap();
    println!(
        "| seed | VO | d-Knn | worst pair | median pair | person s | machine s | next pose s |"
    );
    let rows: Vec<Row> = (1..=10).map(|seed| Row::of(seed, &never_asked)).collect();
    let of = |value: fn(&Row) -> f64| rows.iter().map(value).collect::<Vec<f64>>();
    let most = |value: fn(&Row) -> f64| of(value).into_iter().fold(f64::MIN, f64::max);
    let occupancy = median(of(|row| row.occupancy));
    println!(
        "median occupancy {occupancy:.3}, of the median pairs {:.1}; at most: pair {:.1}, machine {:.1} s, next pose {:.2} s",
        median(of(|row| row.off.1)),
        most(|row| row.off.0),
        most(|row| row.machine_s),
        most(|row| row.next_pose_s)
    );
    assert!(rows.iter().all(|row| row.is_good), "a map is not good");
    assert!(occupancy >= 0.93, "{occupancy}");
    assert!(most(|row| row.off.0) <= 25.0, "a reference pair is far off");
    assert!(median(of(|row| row.off.1)) <= 8.0, "the pairs are far off");
    // Processor seconds: other work on this computer counts little. The starts of the last stage share two processors.
    assert!(
        most(|row| row.machine_s) <= 2.0 * 20.0,
        "the machine is slow"
    );
    assert!(most(|row| row.next_pose_s) <= 1.0, "the next pose is late");
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
