//! The training on a thread of its own, so that neither the view nor the glove waits for it.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Result;
use trainer::data::{Matrix, Pairs};
use trainer::model::Model;

use crate::failure::{Failure, OrFail};
use crate::training::lessons::Lessons;

/// Answers that may wait.
const QUEUE: usize = 16;

/// A question: what comes after these pairs?
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// Of the question, from 1.
    pub number: u64,
    /// The start poses, radians and counts.
    pub start: Pairs,
    /// The pairs of the rounds.
    pub taught: Pairs,
    /// Targets that are not wanted.
    pub passed_over: Matrix,
}

/// An answer.
#[derive(Debug)]
pub struct Learned {
    /// Of the question.
    pub number: u64,
    /// The next target.
    pub target: Option<Vec<f32>>,
    /// The map as it stands.
    pub model: Arc<Model>,
    /// How long it took.
    pub took: Duration,
}

/// The newest question that was not answered yet: none before it counts.
type Newest = Arc<Mutex<Option<Wanted>>>;

/// A training on its thread.
#[derive(Debug)]
pub struct Learner {
    newest: Newest,
    /// Wakes it.
    questions: Option<SyncSender<()>>,
    answers: Receiver<Result<Learned>>,
    thread: Option<JoinHandle<Lessons>>,
}

impl Learner {
    /// Starts it.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(lessons: Lessons) -> Result<Self> {
        let (questions, asked) = sync_channel(1);
        let newest = Newest::default();
        let waiting = Arc::clone(&newest);
        let (answer, answers) = sync_channel(QUEUE);
        let thread = std::thread::Builder::new()
            .name("learner".to_owned())
            .spawn(move || work(lessons, (&asked, &waiting), &answer))
            .or_fail(
                || "nothing can be learned".to_owned(),
                "ending other programs",
            )?;
        Ok(Self {
            newest,
            questions: Some(questions),
            answers,
            thread: Some(thread),
        })
    }

    /// Asks, in place of what was asked before and not begun yet. Never waits.
    pub fn ask(&self, wanted: Wanted) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(wanted);
        if let Some(questions) = &self.questions {
            // Where it was woken already it finds the newer one.
            let _ = questions.try_send(());
        }
    }

    /// The next answer, waited for by `time` at most.
    ///
    /// # Errors
    /// What stopped the training.
    pub fn answer(&self, time: Duration) -> Result<Option<Learned>> {
        use std::sync::mpsc::RecvTimeoutError::{Disconnected, Timeout};
        match self.answers.recv_timeout(time) {
            Ok(answer) => answer.map(Some),
            Err(Timeout) => Ok(None),
            Err(Disconnected) => Err(fault()),
        }
    }

    /// Ends it; the training goes on elsewhere.
    ///
    /// # Errors
    /// It ended by a fault.
    pub fn end(mut self) -> Result<Lessons> {
        self.questions = None;
        let thread = self.thread.take();
        thread
            .and_then(|thread| thread.join().ok())
            .ok_or_else(fault)
    }
}

fn fault() -> anyhow::Error {
    Failure::new(
        "the training stopped on a fault of the program's own",
        "the same again, and report what it says",
    )
    .into()
}

fn work(
    mut lessons: Lessons,
    (asked, newest): (&Receiver<()>, &Mutex<Option<Wanted>>),
    answer: &SyncSender<Result<Learned>>,
) -> Lessons {
    while asked.recv().is_ok() {
        let mut place = newest.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(wanted) = place.take() else {
            continue;
        };
        drop(place);
        let began = Instant::now();
        let lesson = lessons.next(&wanted.start, &wanted.taught, &wanted.passed_over);
        let learned = lesson.map(|lesson| Learned {
            number: wanted.number,
            target: lesson.target,
            model: lesson.model,
            took: began.elapsed(),
        });
        if answer.send(learned).is_err() {
            break;
        }
    }
    lessons
}
