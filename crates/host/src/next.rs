//! Next steps as data: what a person can do about something, in words and as commands that can be pasted.
//!
//! A step is put together where the port, the unit and the file are known, written out in one place (its [`Display`]) and
//! given to programs as it is: `"try"` in words, `"commands"` word by word.
//!
//! [`Display`]: std::fmt::Display

use std::fmt;
use std::path::Path;

use serde::Serialize;
use serde::ser::{SerializeStruct, Serializer};

/// A command line: the program and its arguments, each as the program gets it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Command {
    words: Vec<String>,
}

impl Command {
    /// `gauntlet` with this verb, and with the verb below it where there is one ("gripper status").
    pub fn gauntlet(verb: &str) -> Self {
        let verbs = verb.split_whitespace().map(str::to_owned);
        Self {
            words: std::iter::once("gauntlet".to_owned())
                .chain(verbs)
                .collect(),
        }
    }

    /// Words to add to a command line.
    pub fn more() -> Self {
        Self { words: Vec::new() }
    }

    /// Another program.
    pub fn program(name: &str) -> Self {
        Self {
            words: vec![name.to_owned()],
        }
    }

    /// With one more argument.
    #[must_use]
    pub fn word(mut self, word: impl Into<String>) -> Self {
        self.words.push(word.into());
        self
    }

    /// With an option and its value.
    #[must_use]
    pub fn option(self, name: &str, value: impl ToString) -> Self {
        self.word(name).word(value.to_string())
    }

    /// With an option whose value is a path.
    #[must_use]
    pub fn path(self, name: &str, path: &Path) -> Self {
        self.option(name, path.display())
    }

    /// The command line `words` once more, without these options and their values.
    pub fn again(words: &[String], without: &[&str]) -> Self {
        let mut kept = Vec::new();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            let name = word.split('=').next().unwrap_or_default();
            match without.contains(&name) {
                true if name == word => drop(words.next()),
                true => {}
                false => kept.push(word.clone()),
            }
        }
        Self { words: kept }
    }

    /// The program and its arguments.
    pub fn words(&self) -> &[String] {
        &self.words
    }

    /// A next step that goes on after this command.
    pub fn then(self, more: impl Into<NextStep>) -> NextStep {
        NextStep::from(self).then(more)
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, word) in self.words.iter().enumerate() {
            let space = if index == 0 { "" } else { " " };
            write!(f, "{space}{}", quoted(word))?;
        }
        Ok(())
    }
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-:+,@%=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A piece of a step.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Words(String),
    Command(Command),
    /// What was typed, once more, with this added: a command as soon as somebody knows what was typed.
    Same(Vec<String>),
}

/// What a person can do next: words, and commands between them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct NextStep {
    parts: Vec<Part>,
}

impl NextStep {
    /// This, and then that: the words run on.
    #[must_use]
    pub fn then(mut self, more: impl Into<Self>) -> Self {
        self.parts.extend(more.into().parts);
        self
    }

    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// What was typed, once more with `more` added.
    pub fn same(more: Command) -> Self {
        Self {
            parts: vec![Part::Same(more.words)],
        }
    }

    /// The same for whoever typed `words`: "the same again" becomes a command.
    #[must_use]
    pub fn typed(mut self, words: &[String]) -> Self {
        for part in &mut self.parts {
            if let Part::Same(more) = part {
                // An option with a value replaces the one that was typed.
                let valued = more.windows(2).filter(|pair| !pair[1].starts_with("--"));
                let replaced: Vec<&str> = valued.map(|pair| pair[0].as_str()).collect();
                let mut command = Command::again(words, &replaced);
                // What is there already is not said twice.
                more.retain(|word| !word.starts_with("--") || !command.words.contains(word));
                command.words.append(more);
                *part = Part::Command(command);
            }
        }
        self
    }

    /// The commands in it.
    pub fn commands(&self) -> impl Iterator<Item = &Command> {
        self.parts.iter().filter_map(|part| match part {
            Part::Command(command) => Some(command),
            Part::Words(_) | Part::Same(_) => None,
        })
    }
}

/// What a person should know before it goes wrong, and what they can do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// What it is, with its value.
    pub what: String,
    /// What helps; nothing to do where it may well be so.
    #[serde(flatten)]
    pub next: NextStep,
}

impl Warning {
    /// `what`, and what helps.
    pub fn new(what: impl Into<String>, next: impl Into<NextStep>) -> Self {
        Self {
            what: what.into(),
            next: next.into(),
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        match self.next.is_empty() {
            true => Ok(()),
            false => write!(f, "; {}", self.next),
        }
    }
}

/// Words in which a step begins.
pub fn advice(words: impl Into<String>) -> NextStep {
    NextStep::from(words.into())
}

impl From<&str> for NextStep {
    fn from(words: &str) -> Self {
        words.to_owned().into()
    }
}

impl From<String> for NextStep {
    fn from(words: String) -> Self {
        let parts = if words.is_empty() {
            Vec::new()
        } else {
            vec![Part::Words(words)]
        };
        Self { parts }
    }
}

impl From<Command> for NextStep {
    fn from(command: Command) -> Self {
        Self {
            parts: vec![Part::Command(command)],
        }
    }
}

impl From<&Self> for NextStep {
    fn from(step: &Self) -> Self {
        step.clone()
    }
}

/// One line; commands stand between backticks.
impl fmt::Display for NextStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for part in &self.parts {
            match part {
                Part::Words(words) => f.write_str(words)?,
                Part::Command(command) => write!(f, "`{command}`")?,
                Part::Same(more) => write!(f, "the same with {}", more.join(" "))?,
            }
        }
        Ok(())
    }
}

/// `"try"`: the whole in words. `"commands"`: each command as a list of its words.
impl Serialize for NextStep {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let commands: Vec<&[String]> = self.commands().map(Command::words).collect();
        let mut step = serializer.serialize_struct("NextStep", 2)?;
        step.serialize_field("try", &self.to_string())?;
        step.serialize_field("commands", &commands)?;
        step.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_command_is_quoted_for_a_shell_and_given_word_by_word_to_a_program() {
        let command = Command::gauntlet("gripper status")
            .path("--gripper", Path::new("/tmp/my port's"))
            .word("");
        let step = advice("looking at it, then ")
            .then(command)
            .then(", which reads it");
        assert_eq!(
            step.to_string(),
            r"looking at it, then `gauntlet gripper status --gripper '/tmp/my port'\''s' ''`, which reads it"
        );
        assert_eq!(
            serde_json::to_value(&step).unwrap(),
            json!({
                "try": step.to_string(),
                "commands": [["gauntlet", "gripper", "status", "--gripper", "/tmp/my port's", ""]],
            })
        );
    }

    #[test]
    fn the_same_again_is_a_command_for_whoever_typed_the_first() {
        let step = advice("it goes on: ").then(NextStep::same(
            Command::more().option("--resume", "a.checkpoint"),
        ));
        assert_eq!(
            step.to_string(),
            "it goes on: the same with --resume a.checkpoint"
        );
        assert_eq!(step.commands().count(), 0);
        let typed = ["gauntlet", "train", "--resume", "b", "--out", "a b"].map(str::to_owned);
        assert_eq!(
            step.typed(&typed).to_string(),
            "it goes on: `gauntlet train --out 'a b' --resume a.checkpoint`"
        );
        let flag = NextStep::same(Command::more().word("--activate"));
        let typed = ["gauntlet", "teleop", "--activate"].map(str::to_owned);
        assert_eq!(
            flag.typed(&typed).to_string(),
            "`gauntlet teleop --activate`"
        );
    }

    #[test]
    fn a_command_again_leaves_out_what_it_is_told_to() {
        let typed = ["gauntlet", "--stop-at", "7", "--out", "a", "--stop-at=7"];
        let again = Command::again(&typed.map(str::to_owned), &["--stop-at"]);
        assert_eq!(again.to_string(), "gauntlet --out a");
    }
}
