//! The guided session: what is said when, and the time in which what the person does is used.

use super::Task;

/// One step of the session, seconds after its beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prompt {
    /// What is asked.
    pub task: Task,
    /// When it is said.
    pub told: f64,
    /// From when on it is used.
    pub from: f64,
    /// … and until when.
    pub to: f64,
}

/// The session: flat, turn, flat, the fingers one by one (index to little, thumb), fists, thumb, free, flat. 57 s.
///
/// A flat pose is used from 2 s after it was asked for: the latest person has lain for half a second then.
#[must_use]
pub fn guided() -> Vec<Prompt> {
    let mut prompts = vec![
        (Task::Flat, 0.0, 2.0, 4.0),
        (Task::Turn, 4.2, 4.6, 17.1),
        (Task::Flat, 17.2, 19.2, 21.2),
    ];
    for (i, finger) in [1, 2, 3, 4, 0].into_iter().enumerate() {
        let at = 21.4 + 2.0 * i as f64;
        prompts.push((Task::Alone(finger), at, at, at + 1.99));
    }
    prompts.extend([
        (Task::Fists, 31.4, 31.4, 39.3),
        (Task::Thumb, 39.4, 39.4, 43.3),
        (Task::Free, 43.4, 43.4, 53.3),
        (Task::Flat, 53.4, 55.4, 57.4),
    ]);
    prompts
        .into_iter()
        .map(|(task, told, from, to)| Prompt {
            task,
            told,
            from,
            to,
        })
        .collect()
}
