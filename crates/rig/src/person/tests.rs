use super::*;

fn degrees(angles: [f64; 25]) -> [f64; 25] {
    angles.map(f64::to_degrees)
}

fn guided_by(traits: Traits) -> Person {
    let mut person = Person::new(traits);
    for prompt in guided() {
        person.ask(prompt.task, prompt.told);
    }
    person
}

#[test]
fn the_latest_person_lies_still_and_nearly_straight_where_a_flat_pose_is_used() {
    for seed in 0..20 {
        let person = guided_by(Traits {
            seed,
            late: Some(LATEST_S),
            ..Traits::default()
        });
        let mut zero = [0.0f64; 25];
        for prompt in guided().iter().filter(|p| p.task == Task::Flat) {
            let at = |t: f64| degrees(person.angles(t));
            let (first, last) = (at(prompt.from), at(prompt.to));
            for j in 0..25 {
                let most = if j < 3 { 5.0 } else { 4.25 };
                assert!(
                    first[j].abs() < most + 0.6,
                    "seed {seed} joint {j}: {}",
                    first[j]
                );
                assert!(
                    (first[j] - last[j]).abs() < 1.2,
                    "seed {seed} joint {j} moves"
                );
                zero[j] += first[j] / 3.0;
            }
            let [w, x, y, z] = person.attitude(prompt.from);
            let height = 2.0 * (y * z + w * x);
            assert!(height > 3.0f64.to_radians().cos(), "seed {seed}: {height}");
        }
        assert!(
            zero.iter().any(|off| off.abs() > 0.5),
            "never quite straight"
        );
    }
}

#[test]
fn an_exact_person_lies_exactly_flat_but_for_a_tremor() {
    let person = guided_by(Traits::exact(3));
    let worst = degrees(person.angles(20.0))
        .into_iter()
        .fold(0.0, |w: f64, a| w.max(a.abs()));
    assert!(worst < 0.6, "{worst}");
}

#[test]
fn the_hand_moves_at_human_speed_and_within_a_hands_limits_whatever_is_asked() {
    for seed in 0..6 {
        let mut person = guided_by(Traits {
            seed,
            ..Traits::default()
        });
        for (i, attitude) in [Attitude::PalmDown, Attitude::ThumbUp, Attitude::Free]
            .into_iter()
            .enumerate()
        {
            person.ask(Task::Use(attitude), 60.0 + 10.0 * i as f64);
        }
        let mut before = (person.angles(-1.0), person.attitude(-1.0));
        for step in 1..9_100 {
            let t = -1.0 + 0.01 * f64::from(step);
            let now = (person.angles(t), person.attitude(t));
            for (j, (a, b)) in before.0.iter().zip(now.0).enumerate() {
                let speed = (b - a).abs().to_degrees() / 0.01;
                assert!(
                    speed < 900.0,
                    "seed {seed} joint {j} at {t}: {speed} degrees a second"
                );
                let (low, high) = glove::hand::LIMITS[j];
                let off = 0.18;
                assert!(
                    b > f64::from(low) - off && b < f64::from(high) + off,
                    "joint {j} at {t}: {b}"
                );
            }
            let dot: f64 = before.1.iter().zip(now.1).map(|(a, b)| a * b).sum();
            let turned = 2.0 * dot.abs().min(1.0).acos().to_degrees() / 0.01;
            assert!(
                turned < 900.0,
                "seed {seed} at {t}: the hand turns {turned} degrees a second"
            );
            before = now;
        }
    }
}

#[test]
fn a_posture_that_is_asked_for_is_taken_with_the_persons_error_and_lateness() {
    let wanted: [f64; 25] = std::array::from_fn(|j| 0.01 * j as f64);
    let mut person = Person::new(Traits {
        seed: 5,
        late: Some(0.5),
        ..Traits::default()
    });
    person.ask(Task::Posture(wanted), 10.0);
    let off = |t: f64| {
        let angles = person.angles(t);
        let far = angles
            .iter()
            .zip(wanted)
            .map(|(a, w)| (a - w).abs().to_degrees());
        far.fold(0.0, f64::max)
    };
    let never_asked = Person::new(person.traits.clone());
    assert_eq!(person.angles(10.49), never_asked.angles(10.49), "too early");
    assert_ne!(person.angles(10.6), never_asked.angles(10.6));
    assert!((0.5..10.0).contains(&off(11.5)), "{}", off(11.5));
}

#[test]
fn attitudes_in_use_are_what_they_are_called() {
    let mut person = Person::new(Traits {
        seed: 9,
        late: Some(0.0),
        ..Traits::default()
    });
    person.ask(Task::Use(Attitude::PalmDown), 0.0);
    person.ask(Task::Use(Attitude::ThumbUp), 100.0);
    person.ask(Task::Use(Attitude::Free), 200.0);
    let up = |t: f64| {
        let [w, x, y, z] = person.attitude(t);
        // Height of the hand's x and y.
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x)]
    };
    let times = |from: f64| (0..9_000).map(move |i| from + 1.0 + 0.01 * f64::from(i));
    assert!(times(0.0).all(|t| up(t)[1] > 42.5f64.to_radians().cos()));
    assert!(times(100.0).all(|t| up(t)[0] > 17.0f64.to_radians().cos()));
    let lowest = times(200.0).map(|t| up(t)[1]).fold(1.0, f64::min);
    assert!(lowest < -0.8, "{lowest}");
}

#[test]
fn the_same_seed_is_the_same_person_whatever_was_asked_when() {
    let traits = Traits {
        seed: 11,
        ..Traits::default()
    };
    let (a, b) = (guided_by(traits.clone()), guided_by(traits));
    let later: Vec<_> = [50.0, 3.0, 27.3].map(|t| a.angles(t)).to_vec();
    let sooner: Vec<_> = [27.3, 3.0, 50.0].map(|t| b.angles(t)).to_vec();
    assert_eq!(later, sooner.into_iter().rev().collect::<Vec<_>>());
}
