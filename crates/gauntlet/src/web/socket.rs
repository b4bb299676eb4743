//! One page's conversation: pictures out, the newest when the one before was drawn; wishes in, so many a second.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket};
use serde::Deserialize;
use tokio::time::{Instant, timeout};

use super::inbox::{PageId, Said, Wish};
use super::picture::VERSION;
use super::shared::Shared;
use host::clock::since_boot;

/// Pages at once.
const PAGES: usize = 8;
/// Messages of one page in a second: 60 pictures asked for, 10 heartbeats, and what a person does by hand.
const MESSAGES: u32 = 150;
/// A message that a page does not take for so long ends its connection.
const STUCK: Duration = Duration::from_secs(1);
/// Pictures whose times are remembered: more than a page can have under way.
const REMEMBERED: usize = 8;
/// A picture of which nobody knows when it was made is so old.
const UNKNOWN: Duration = Duration::from_secs(3_600);

/// What a page says.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Heard {
    /// `ready`, `close`, `beat`, `open` or `do`.
    is: Word,
    /// The picture that was drawn last.
    #[serde(default)]
    seen: u64,
    /// Which action.
    #[serde(default)]
    what: String,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    Ready,
    Close,
    Beat,
    Open,
    Do,
}

/// Serves one page until it goes, says what it must not, or the program ends.
pub(super) async fn serve(mut socket: WebSocket, shared: Arc<Shared>) {
    // Counted before anything is waited for: no more than so many are served.
    if shared.open.fetch_add(1, Ordering::Relaxed) >= PAGES {
        let why =
            format!("{PAGES} pages are open already: close one of them, then load this one again");
        close(&mut socket, why).await;
    } else {
        let page = shared.pages.fetch_add(1, Ordering::Relaxed) + 1;
        let why = converse(&mut socket, &shared, page).await;
        // First of all: the goodbye may wait for a page that takes nothing.
        shared.inbox.put(Said::now(page, Wish::Gone, UNKNOWN));
        if let Some(why) = why {
            close(&mut socket, why).await;
        }
    }
    shared.open.fetch_sub(1, Ordering::Relaxed);
}

async fn close(socket: &mut WebSocket, why: String) {
    let frame = CloseFrame {
        code: axum::extract::ws::close_code::POLICY,
        reason: why.into(),
    };
    // Whoever is gone needs no goodbye.
    let _ = timeout(STUCK, socket.send(Message::Close(Some(frame)))).await;
}

async fn send(socket: &mut WebSocket, text: Utf8Bytes) -> bool {
    let sent = timeout(STUCK, socket.send(Message::Text(text))).await;
    matches!(sent, Ok(Ok(())))
}

/// Returns why the page is told to go, if it is not gone.
async fn converse(socket: &mut WebSocket, shared: &Shared, page: PageId) -> Option<String> {
    let hello = serde_json::json!({"is": "hello", "page": page, "version": VERSION});
    if !send(socket, hello.to_string().into()).await {
        return None;
    }
    let mut pictures = shared.pictures.subscribe();
    let mut map = shared.map.subscribe();
    let mut over = shared.over.subscribe();
    pictures.mark_changed();
    map.mark_changed();
    let mut ready = true;
    let mut drawn = Drawn::default();
    let mut allowance = Allowance::new();
    loop {
        tokio::select! {
            biased;
            _ = async { over.wait_for(|over| *over).await.is_ok() } => {
                return Some("the program has ended".to_owned());
            }
            message = socket.recv() => {
                let text = match message? {
                    Ok(Message::Text(text)) => text,
                    Ok(Message::Ping(_) | Message::Pong(_)) if allowance.take() => continue,
                    Ok(Message::Ping(_) | Message::Pong(_)) => return Some(too_many()),
                    Ok(Message::Binary(_)) => return Some("a message that is no text".to_owned()),
                    Ok(Message::Close(_)) | Err(_) => return None,
                };
                if !allowance.take() {
                    return Some(too_many());
                }
                let Ok(heard) = serde_json::from_str::<Heard>(&text) else {
                    return Some("a message that means nothing".to_owned());
                };
                match heard.is {
                    Word::Ready => ready = true,
                    word => shared.inbox.put(said(page, word, heard, &drawn)),
                }
            }
            Ok(()) = map.changed() => {
                let text = map.borrow_and_update().clone();
                if let Some(text) = text && !send(socket, text).await {
                    return None;
                }
            }
            Ok(()) = pictures.changed(), if ready => {
                let picture = pictures.borrow_and_update().clone();
                if let Some(picture) = picture {
                    ready = false;
                    drawn.sent(picture.number, picture.at);
                    if !send(socket, picture.text).await {
                        return None;
                    }
                }
            }
        }
    }
}

fn too_many() -> String {
    format!("more than {MESSAGES} messages in a second")
}

fn said(page: PageId, word: Word, heard: Heard, drawn: &Drawn) -> Said {
    let wish = match word {
        Word::Close => Wish::Close,
        Word::Beat => Wish::Beat,
        Word::Do => Wish::Do(heard.what),
        Word::Open | Word::Ready => Wish::Open,
    };
    Said::now(page, wish, drawn.age(heard.seen, since_boot()))
}

/// The pictures that were sent last, and when each was made.
#[derive(Debug, Default)]
struct Drawn(VecDeque<(u64, Duration)>);

impl Drawn {
    fn sent(&mut self, number: u64, at: Duration) {
        if self.0.len() == REMEMBERED {
            self.0.pop_front();
        }
        self.0.push_back((number, at));
    }

    fn age(&self, number: u64, now: Duration) -> Duration {
        let known = self.0.iter().find(|(sent, _)| *sent == number);
        known.map_or(UNKNOWN, |(_, at)| now.saturating_sub(*at))
    }
}

/// How much a page may still say in this second.
struct Allowance {
    second: Instant,
    left: u32,
}

impl Allowance {
    fn new() -> Self {
        Self {
            second: Instant::now(),
            left: MESSAGES,
        }
    }

    fn take(&mut self) -> bool {
        if self.second.elapsed() >= Duration::from_secs(1) {
            *self = Self::new();
        }
        self.left = self.left.saturating_sub(1);
        self.left > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_as_old_as_it_is_and_an_unknown_one_is_very_old() {
        let mut drawn = Drawn::default();
        let ms = Duration::from_millis;
        (1..=20).for_each(|number| drawn.sent(number, ms(20 * number)));
        assert_eq!(drawn.age(20, ms(430)), ms(30));
        assert_eq!(drawn.age(13, ms(430)), ms(170));
        for unknown in [0, 12, 21] {
            assert_eq!(drawn.age(unknown, ms(430)), UNKNOWN);
        }
    }

    #[test]
    fn messages_are_words_and_nothing_else() {
        let heard = |text| serde_json::from_str::<Heard>(text);
        assert!(heard(r#"{"is":"beat","seen":7}"#).is_ok_and(|heard| heard.seen == 7));
        for text in [
            r#"{"is":"engage"}"#,
            r#"{"is":"beat","seen":-1}"#,
            r#"{"is":"beat","more":1}"#,
            "beat",
            "[]",
        ] {
            assert!(heard(text).is_err(), "{text}");
        }
    }
}
