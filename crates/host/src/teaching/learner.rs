//! The training on a thread of its own, so that neither the view nor the glove waits for it.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Result;
use trainer::data::{Matrix, Pairs};
use trainer::model::Model;

use crate::failure::{Failure, OrFail};
use crate::training::lessons::Lessons;

/// Questions, and answers, that may wait; of the questions only the newest counts.
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

/// A training on its thread.
#[derive(Debug)]
pub struct Learner {
    questions: Option<SyncSender<Wanted>>,
    answers: Receiver<Result<Learned>>,
    thread: Option<JoinHandle<Lessons>>,
}

impl Learner {
    /// Starts it.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(lessons: Lessons) -> Result<Self> {
        let (questions, asked) = sync_channel(QUEUE);
        let (answer, answers) = sync_channel(QUEUE);
        let thread = std::thread::Builder::new()
            .name("learner".to_owned())
            .spawn(move || work(lessons, &asked, &answer))
            .or_fail(
                || "nothing can be learned".to_owned(),
                "ending other programs",
            )?;
        Ok(Self {
            questions: Some(questions),
            answers,
            thread: Some(thread),
        })
    }

    /// Asks. Never waits: a learner that is so far behind has newer questions to answer.
    pub fn ask(&self, wanted: Wanted) {
        if let Some(questions) = &self.questions {
            let _ = questions.try_send(wanted);
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
    asked: &Receiver<Wanted>,
    answer: &SyncSender<Result<Learned>>,
) -> Lessons {
    while let Ok(mut wanted) = asked.recv() {
        while let Ok(newer) = asked.try_recv() {
            wanted = newer;
        }
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
