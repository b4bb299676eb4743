//! What a child says, as it says it: a test waits for the words, not for a time.

use std::io::Read;
use std::process::{Child, Output, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::{command, interrupt, wait};

/// No word of these tests may take longer, on a busy machine too.
const DEADLINE: Duration = Duration::from_secs(120);

/// A pipe, read by a thread: the child never waits for its reader.
pub struct Told {
    said: Arc<Mutex<Vec<u8>>>,
    reader: std::thread::JoinHandle<()>,
}

impl Told {
    pub fn by(mut pipe: impl Read + Send + 'static) -> Self {
        let said = Arc::new(Mutex::new(Vec::new()));
        let keep = said.clone();
        let reader = std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = pipe.read(&mut bytes) {
                keep.lock().unwrap().extend(&bytes[..count]);
            }
        });
        Self { said, reader }
    }

    /// All so far.
    pub fn so_far(&self) -> String {
        String::from_utf8_lossy(&self.said.lock().unwrap()).into_owned()
    }

    /// Waits until what was said after the first `from` bytes holds `word`; how much was said then.
    pub fn until(&self, from: usize, word: &str) -> usize {
        self.until_one_of(from, &[word])
    }

    /// The same for any of some words.
    pub fn until_one_of(&self, from: usize, words: &[&str]) -> usize {
        let end = Instant::now() + DEADLINE;
        loop {
            let said = self.so_far();
            let new = said.get(from..).unwrap_or_default();
            if words.iter().any(|word| new.contains(word)) {
                return said.len();
            }
            let over = self.reader.is_finished() || Instant::now() > end;
            assert!(!over, "never said {words:?}: {said}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// All, once the child has ended.
    pub fn all(self) -> String {
        self.reader.join().unwrap();
        String::from_utf8_lossy(&self.said.lock().unwrap()).into_owned()
    }
}

/// Starts it with both pipes read.
pub fn started(arguments: &[&str]) -> (Child, Told, Told) {
    let mut child = command(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = Told::by(child.stdout.take().unwrap());
    let errors = Told::by(child.stderr.take().unwrap());
    (child, said, errors)
}

/// Starts it, waits until its standard output holds `word`, sends what Ctrl-C sends, and runs to the end; how long that took.
pub fn interrupted_at(word: &str, arguments: &[&str]) -> (Output, Duration) {
    let (mut child, said, errors) = started(arguments);
    said.until(0, word);
    interrupt(&child);
    let asked = Instant::now();
    let status = wait(&mut child);
    let took = asked.elapsed();
    let output = Output {
        status,
        stdout: said.all().into_bytes(),
        stderr: errors.all().into_bytes(),
    };
    (output, took)
}
