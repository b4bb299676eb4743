use super::*;
use glove::Duration;
use glove::hand::LIMITS;
use trainer::hand::{Scripted, Space};
use trainer::operator::Operator;

const SCAN: Duration = Duration::from_ticks(28_000);
const TARGETS: [[f32; 4]; 3] = [
    [255.0, 0.0, 0.0, 0.0],
    [0.0, 255.0, 0.0, 130.0],
    [0.0, 0.0, 255.0, 255.0],
];

struct Bench {
    teaching: Teaching,
    now: Instant,
    told: Vec<News>,
}

impl Bench {
    fn new(pairs: Vec<Taught>) -> Self {
        Self::after(Earlier {
            pairs,
            passed_over: Matrix::default(),
        })
    }

    fn after(earlier: Earlier) -> Self {
        let now = Instant::from_ticks(0);
        Self {
            teaching: Teaching::new(Aim::Gripper(Space::ThreeFinger), 2, earlier, now),
            now,
            told: Vec::new(),
        }
    }

    /// The hand shows `angles` for some seconds; the learner answers with the target of its number.
    fn hold(&mut self, angles: [f32; JOINT_COUNT], seconds: f32) {
        for _ in 0..(seconds * 1e6 / 28_000.0) as u32 {
            self.now += SCAN;
            self.teaching.take(&angles, self.now);
            self.hear();
        }
    }

    fn hear(&mut self) {
        while let Some(news) = self.teaching.next_news() {
            if let News::Learn(wanted) = &news {
                let target = TARGETS.get(wanted.taught.inputs.rows + wanted.passed_over.rows);
                let target = target.map(|target| target.to_vec());
                self.teaching.learned(wanted.number, target, self.now);
            }
            self.told.push(news);
        }
    }

    fn act(&mut self, act: Act) {
        self.teaching.act(act, self.now);
        self.hear();
    }

    fn state(&self) -> State {
        self.teaching.ask(self.now).state
    }

    fn target(&self) -> Vec<f32> {
        self.teaching.ask(self.now).target.unwrap()
    }
}

fn shown(target: &[f32]) -> [f32; JOINT_COUNT] {
    let mut operator = Scripted::new(Space::ThreeFinger, &LIMITS);
    operator.demonstrate(target).unwrap().try_into().unwrap()
}

/// The two start poses and two rounds.
fn whole() -> Bench {
    let mut bench = Bench::new(Vec::new());
    bench.hear();
    for _ in 0..4 {
        let target = bench.target();
        bench.hold(shown(&target), 3.5);
    }
    bench
}

#[test]
fn open_hand_and_fist_come_first_then_each_round_s_target_then_the_map_can_be_tried() {
    let bench = whole();
    let taken: Vec<_> = bench
        .teaching
        .pairs()
        .iter()
        .map(|pair| pair.target.clone())
        .collect();
    assert_eq!(taken[0], Space::ThreeFinger.start()[0]);
    assert_eq!(taken[1], Space::ThreeFinger.start()[1]);
    assert_eq!(taken[2..], TARGETS[..2]);
    assert_eq!(bench.state(), State::Trying);
    assert!(bench.told.contains(&News::Complete));
}

#[test]
fn the_pose_before_is_not_taken_again_for_the_next_target() {
    let mut bench = Bench::new(Vec::new());
    bench.hear();
    bench.hold(shown(Space::ThreeFinger.start()[0]), 20.0);
    assert_eq!(bench.teaching.pairs().len(), 1);
    assert!(
        bench
            .told
            .contains(&News::Refused(Doubt::Alike { pair: 1 })),
        "after a while it is said why"
    );
}

#[test]
fn a_pose_much_like_an_earlier_one_is_refused_with_a_word_and_taken_where_the_person_insists() {
    let mut bench = Bench::new(Vec::new());
    bench.hear();
    let [open, fist] = Space::ThreeFinger.start();
    bench.hold(shown(open), 3.5);
    bench.hold(shown(fist), 3.5);
    // The open hand once more, for another target.
    bench.hold(shown(open), 3.5);
    assert!(
        bench
            .told
            .contains(&News::Refused(Doubt::Alike { pair: 1 })),
        "{:?}",
        bench.told
    );
    assert_eq!(bench.teaching.pairs().len(), 2);
    bench.act(Act::Capture);
    assert_eq!(bench.teaching.pairs().len(), 3);
}

#[test]
fn a_key_takes_a_hand_that_does_not_hold_still_and_nothing_where_no_hand_is_seen() {
    let mut bench = Bench::new(Vec::new());
    bench.hear();
    bench.act(Act::Capture);
    assert_eq!(bench.told.last(), Some(&News::Refused(Doubt::Unseen)));
    bench.hold(shown(&TARGETS[0]), 0.2);
    bench.act(Act::Capture);
    assert_eq!(bench.teaching.pairs().len(), 1);
}

#[test]
fn what_was_taken_back_is_asked_again_and_can_be_brought_back() {
    let mut bench = whole();
    let before = bench.teaching.pairs().to_vec();
    bench.act(Act::Undo);
    assert_eq!(bench.target(), TARGETS[1]);
    bench.act(Act::Undo);
    assert_eq!(bench.target(), TARGETS[0]);
    bench.act(Act::Redo);
    bench.act(Act::Redo);
    assert_eq!(bench.teaching.pairs(), before);
    assert_eq!(bench.state(), State::Trying);
    for _ in 0..9 {
        bench.act(Act::Undo);
    }
    assert!(bench.teaching.pairs().is_empty());
    assert_eq!(bench.target(), Space::ThreeFinger.start()[0]);
}

#[test]
fn a_pose_that_is_passed_over_is_followed_by_another_and_a_start_pose_is_not() {
    let mut bench = Bench::new(Vec::new());
    bench.hear();
    bench.act(Act::Skip);
    assert_eq!(bench.target(), Space::ThreeFinger.start()[0]);
    for target in Space::ThreeFinger.start() {
        bench.hold(shown(target), 3.5);
    }
    assert_eq!(bench.target(), TARGETS[0]);
    bench.act(Act::Skip);
    assert_eq!(bench.target(), TARGETS[1]);
}

#[test]
fn more_pairs_can_be_added_and_only_a_whole_session_can_be_finished() {
    let mut bench = Bench::new(Vec::new());
    bench.hear();
    bench.act(Act::Finish);
    assert_eq!(bench.state(), State::Asking(Stage::Unseen));
    let mut bench = whole();
    bench.act(Act::More);
    assert_eq!(bench.target(), TARGETS[2]);
    bench.hold(shown(&TARGETS[2]), 3.5);
    assert_eq!(bench.state(), State::Trying);
    bench.act(Act::Finish);
    assert_eq!(bench.state(), State::Finished);
}

#[test]
fn a_session_goes_on_after_the_pairs_that_were_kept() {
    let kept = whole().teaching.pairs()[..3].to_vec();
    let mut bench = Bench::new(kept);
    bench.hear();
    assert_eq!(bench.target(), TARGETS[1]);
    assert_eq!(bench.teaching.ask(bench.now).number, 4);
}

#[test]
fn a_late_answer_of_the_learner_to_an_older_question_is_passed_over() {
    let mut bench = whole();
    bench.teaching.act(Act::Undo, bench.now);
    let Some(News::Learn(wanted)) = bench.teaching.news.pop_back() else {
        panic!("asked");
    };
    bench
        .teaching
        .learned(wanted.number - 1, Some(vec![9.0; 4]), bench.now);
    assert_eq!(bench.state(), State::Choosing);
    bench
        .teaching
        .learned(wanted.number, Some(vec![7.0; 4]), bench.now);
    assert_eq!(bench.target(), vec![7.0; 4]);
}

#[test]
fn a_session_goes_on_without_the_poses_that_were_passed_over() {
    let mut bench = Bench::new(whole().teaching.pairs()[..2].to_vec());
    bench.hear();
    bench.act(Act::Skip);
    assert!(bench.told.contains(&News::PassedOver));
    assert_eq!(bench.teaching.passed_over().row(0), TARGETS[0]);
    let earlier = Earlier {
        pairs: bench.teaching.pairs().to_vec(),
        passed_over: bench.teaching.passed_over().clone(),
    };
    let mut bench = Bench::after(earlier);
    bench.hear();
    assert_eq!(bench.target(), TARGETS[1]);
}

#[test]
fn a_pair_more_than_was_planned_is_there_where_the_session_goes_on() {
    let mut bench = whole();
    bench.act(Act::More);
    bench.hold(shown(&TARGETS[2]), 3.5);
    let pairs = bench.teaching.pairs().to_vec();
    assert_eq!(pairs.len(), 5);
    let mut bench = Bench::new(pairs.clone());
    bench.hear();
    assert_eq!(bench.teaching.pairs(), pairs);
    assert_eq!(bench.state(), State::Trying);
}

#[test]
fn nobody_listens_for_a_thousand_acts_and_the_newest_is_heard_then_and_every_act_counts() {
    let mut bench = whole();
    bench.told.clear();
    for _ in 0..500 {
        bench.teaching.act(Act::Undo, bench.now);
        bench.teaching.act(Act::Redo, bench.now);
    }
    bench.teaching.act(Act::Undo, bench.now);
    assert_eq!(bench.teaching.counts().taken_back, 501);
    let heard: Vec<News> = std::iter::from_fn(|| bench.teaching.next_news()).collect();
    let [News::Changed(3), News::Learn(wanted)] = &heard[..] else {
        panic!("{heard:?}");
    };
    // The question is the newest: whoever answers it is understood.
    let answer = Some(TARGETS[1].to_vec());
    bench.teaching.learned(wanted.number, answer, bench.now);
    assert_eq!(bench.target(), TARGETS[1]);
}

#[test]
fn a_key_right_after_a_pose_was_asked_takes_nothing_from_before() {
    let mut bench = Bench::new(Vec::new());
    bench.hear();
    let [open, fist] = Space::ThreeFinger.start();
    bench.hold(shown(open), 3.5);
    assert_eq!(bench.target(), *fist);
    bench.now += SCAN;
    // Asked at once and answered by nothing yet.
    bench.teaching.act(Act::Undo, bench.now);
    bench.act(Act::Capture);
    assert_eq!(bench.told.last(), Some(&News::Refused(Doubt::Unseen)));
    assert!(bench.teaching.pairs().is_empty());
}
