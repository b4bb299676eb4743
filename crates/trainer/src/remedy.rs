//! Errors that say what helps, apart from what is wrong.

/// An error whose text says what is wrong; what helps stands beside it.
pub trait Remedy: std::error::Error {
    /// What helps, in words that go on after "try:". Empty where nothing is known.
    fn remedy(&self) -> String;

    /// Both in one line.
    fn told(&self) -> String {
        match self.remedy() {
            remedy if remedy.is_empty() => self.to_string(),
            remedy => format!("{self}; {remedy}"),
        }
    }
}
