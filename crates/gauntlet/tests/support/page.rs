//! A page without a browser: the page's side of the conversation, as `view.js` holds it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::protocol::CloseFrame;
use tungstenite::{Error, Message, WebSocket};

/// A look at a connection on which nothing may come.
const LOOK: Duration = Duration::from_millis(20);
/// For everything that is waited for.
pub const PATIENCE: Duration = Duration::from_secs(40);

/// `127.0.0.1:PORT` and `/TOKEN/` of a page's address.
pub fn parts(address: &str) -> (&str, &str) {
    let rest = address.strip_prefix("http://").unwrap();
    rest.split_at(rest.find('/').unwrap())
}

/// The page's address, from what a run says; the rest is read, so that it never waits for its reader.
pub fn address(said: impl Read + Send + 'static) -> String {
    let mut reader = BufReader::new(said);
    let mut line = String::new();
    while !line.starts_with("page ") {
        line.clear();
        assert!(reader.read_line(&mut line).unwrap() > 0, "no page");
    }
    std::thread::spawn(move || std::io::copy(&mut reader, &mut std::io::sink()));
    line.split_whitespace().nth(1).unwrap().to_owned()
}

/// The status line and the rest of the answer to a request, written as it is.
pub fn answer(at: &str, request: &str) -> (String, String) {
    let mut stream = TcpStream::connect(at).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    let (status, rest) = text.split_once("\r\n").unwrap();
    (status.to_owned(), rest.to_owned())
}

/// A page that is open.
pub struct OpenPage {
    socket: WebSocket<TcpStream>,
    /// Which page it is.
    pub id: u64,
    /// The picture that came last, and its number.
    pub picture: Value,
    pub number: u64,
    pub pictures: u64,
}

impl OpenPage {
    /// As a browser opens it.
    pub fn open(address: &str) -> Self {
        let (at, _) = parts(address);
        Self::from(address, Some(&format!("http://{at}"))).unwrap()
    }

    /// From a page that came from `origin`; else the status it was refused with.
    pub fn from(address: &str, origin: Option<&str>) -> Result<Self, u16> {
        let (at, path) = parts(address);
        let url = format!("ws://{at}{path}socket");
        let mut request = url.into_client_request().unwrap();
        if let Some(origin) = origin {
            let value = HeaderValue::from_str(origin).unwrap();
            request.headers_mut().insert("Origin", value);
        }
        let stream = TcpStream::connect(at).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = match tungstenite::client(request, stream) {
            Ok(opened) => opened,
            Err(tungstenite::HandshakeError::Failure(Error::Http(response))) => {
                return Err(response.status().as_u16());
            }
            Err(other) => panic!("{other}"),
        };
        socket.get_ref().set_read_timeout(Some(LOOK)).unwrap();
        let mut page = Self {
            socket,
            id: 0,
            picture: Value::Null,
            number: 0,
            pictures: 0,
        };
        page.until("hello", |page| page.id > 0);
        Ok(page)
    }

    /// Says something, as of the picture seen last.
    pub fn say(&mut self, word: &str) {
        self.say_of(word, self.number);
    }

    /// Says something, as of the picture `seen`.
    pub fn say_of(&mut self, word: &str, seen: u64) {
        self.raw(json!({"is": word, "seen": seen}).to_string());
    }

    pub fn raw(&mut self, text: String) {
        // One that was told to go takes nothing any more.
        let _ = self.socket.send(Message::Text(text.into()));
    }

    /// What comes within a look; why it was closed, where it was.
    pub fn look(&mut self) -> Result<(), Option<String>> {
        match self.socket.read() {
            Ok(Message::Text(text)) => {
                let mut message: Value = serde_json::from_str(&text).unwrap();
                match message["is"].as_str().unwrap() {
                    "hello" => self.id = message["page"].as_u64().unwrap(),
                    "picture" => {
                        self.number = message["number"].as_u64().unwrap();
                        self.picture = message["picture"].take();
                        self.pictures += 1;
                        self.say("ready");
                    }
                    _ => {}
                }
                Ok(())
            }
            Ok(Message::Close(frame)) => {
                Err(frame.map(|frame: CloseFrame| frame.reason.to_string()))
            }
            Ok(_) => Ok(()),
            Err(Error::Io(error))
                if matches!(
                    error.kind(),
                    std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut
                ) =>
            {
                Ok(())
            }
            Err(_) => Err(None),
        }
    }

    /// Until it is so.
    pub fn until(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        self.until_with(what, done, |_| {});
    }

    /// Until it is so, while the button is held down.
    pub fn until_holding(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        let mut beat = Instant::now();
        self.until_with(what, done, |page| {
            if beat.elapsed() >= Duration::from_millis(100) {
                beat = Instant::now();
                page.say("beat");
            }
        });
    }

    fn until_with(
        &mut self,
        what: &str,
        done: impl Fn(&Self) -> bool,
        mut meanwhile: impl FnMut(&mut Self),
    ) {
        let end = Instant::now() + PATIENCE;
        while !done(self) {
            assert!(Instant::now() < end, "not {what}: {}", self.picture);
            if let Err(why) = self.look() {
                panic!("closed before {what}: {why:?}");
            }
            meanwhile(self);
        }
    }

    /// Why it was told to go.
    pub fn until_closed(&mut self) -> Option<String> {
        let end = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < end, "it stays open");
            if let Err(why) = self.look() {
                return why;
            }
        }
    }

    pub fn clutch(&self) -> &str {
        self.picture["clutch"]["position"].as_str().unwrap_or("")
    }

    /// Whether this page holds the clutch, and the bridge says so.
    pub fn holds(&self) -> bool {
        self.clutch() == "closed" && self.picture["clutch"]["page"] == self.id
    }
}
