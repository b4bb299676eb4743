//! The terminal in raw mode, on its other page; given back when dropped, also in a panic.

use std::io::Write;
use std::sync::Once;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use ratatui::layout::Rect;
use rustix::termios::{
    OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetwinsize, tcsetattr,
};

use crate::out;

/// The other page, with pastes marked.
const ENTER: &[u8] = b"\x1b[?1049h\x1b[?2004h\x1b[2J";
/// Back, with the cursor.
const LEAVE: &[u8] = b"\x1b[?2004l\x1b[?25h\x1b[?1049l";
/// What a terminal has that does not say.
const USUAL: (u16, u16) = (80, 24);
/// The largest that is drawn on.
const LARGEST: (u16, u16) = (640, 200);
/// For what was drawn last to reach the terminal before another program has it.
const SETTLE: Duration = Duration::from_millis(200);

/// How the terminal was before, while it is raw.
static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);
static HOOK: Once = Once::new();

/// A terminal in raw mode.
#[derive(Debug)]
pub(super) struct Raw(());

impl Raw {
    /// Enters raw mode.
    pub(super) fn enter() -> std::io::Result<Self> {
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |panic| {
                leave();
                before(panic);
            }));
        });
        let mut raw = Self(());
        raw.again()?;
        Ok(raw)
    }

    /// Enters it again after [`Raw::leave`].
    pub(super) fn again(&mut self) -> std::io::Result<()> {
        let stdin = std::io::stdin();
        let now = tcgetattr(&stdin)?;
        let mut raw = now.clone();
        raw.make_raw();
        // A read returns at once, with what is there.
        raw.special_codes[SpecialCodeIndex::VMIN] = 0;
        raw.special_codes[SpecialCodeIndex::VTIME] = 0;
        *BEFORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(now);
        tcsetattr(&stdin, OptionalActions::Now, &raw)?;
        print(ENTER);
        Ok(())
    }

    /// Gives the terminal back.
    pub(super) fn leave(&mut self) {
        leave();
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        leave();
    }
}

fn leave() {
    let before = BEFORE.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(before) = before {
        // A terminal that was closed needs nothing.
        let _ = tcsetattr(std::io::stdin(), OptionalActions::Now, &before);
        print(LEAVE);
        out::settle(SETTLE);
    }
}

fn print(bytes: &[u8]) {
    let mut screen = out::Screen::default();
    // A screen takes everything.
    let _ = screen.write_all(bytes).and_then(|()| screen.flush());
}

/// The terminal's size now.
pub(super) fn size() -> Rect {
    let told = tcgetwinsize(std::io::stdout()).ok();
    let (width, height) = told
        .map(|size| (size.ws_col, size.ws_row))
        .filter(|(width, height)| *width > 0 && *height > 0)
        .unwrap_or(USUAL);
    // More nobody has: a wrong size would cost the memory and the time of its cells.
    Rect::new(0, 0, width.min(LARGEST.0), height.min(LARGEST.1))
}
