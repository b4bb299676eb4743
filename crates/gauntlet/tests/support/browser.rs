//! A browser without a screen, told what to do over its debugging port (the Chrome DevTools Protocol).

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

use super::bench::Running;
use super::page::PATIENCE;

/// Names under which it is installed.
const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page, ended with the test.
pub struct Browser {
    _child: Running,
    socket: WebSocket<TcpStream>,
    calls: u64,
    /// What it said without being asked, oldest first.
    pub events: Vec<Value>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Starts it; without one the calling test is skipped.
    #[track_caller]
    pub fn start() -> Option<Self> {
        let found = PROGRAMS.iter().find(|program| {
            let version = Command::new(program).arg("--version").output();
            version.is_ok_and(|output| output.status.success())
        });
        let Some(program) = found else {
            rig::skip::skipped(rig::skip::Need::Peers, "no chromium here");
            return None;
        };
        Some(Self::of(program))
    }

    fn of(program: &str) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let mut command = Command::new(program);
        command
            // As root there is no sandbox, and the page is ours.
            .args(["--headless=new", "--no-sandbox", "--disable-gpu"])
            .args(["--remote-debugging-port=0", "--disable-dev-shm-usage"])
            .args(["--no-first-run", "--disable-background-networking"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        // Ended with the test, wherever that fails.
        let mut child = Running::start(&mut command);
        let mut said = BufReader::new(child.0.stderr.take().unwrap());
        let mut line = String::new();
        let marker = "DevTools listening on ws://";
        while !line.contains(marker) {
            line.clear();
            assert!(said.read_line(&mut line).unwrap() > 0, "{program} ended");
        }
        // It goes on talking.
        std::thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));
        let at = line.split(marker).nth(1).unwrap();
        let at = at.split('/').next().unwrap().to_owned();
        let url = page_of(&at);
        let stream = TcpStream::connect(&at).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(url, stream).unwrap();
        let mut browser = Self {
            _child: child,
            socket,
            calls: 0,
            events: Vec::new(),
            _profile: profile,
        };
        for domain in ["Runtime", "Log", "Page", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser
    }

    /// Calls a method and returns its result.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.calls += 1;
        let call = json!({"id": self.calls, "method": method, "params": parameters});
        self.socket
            .send(Message::Text(call.to_string().into()))
            .unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else {
                continue;
            };
            let mut answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.calls {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].take();
            }
            self.events.push(answer);
        }
    }

    /// A screen of this size, `scale` pixels a point, by a person who prefers `theme`.
    pub fn screen(&mut self, (width, height): (u32, u32), scale: f64, theme: &str) {
        let phone = width < 600;
        let metrics = json!({
            "width": width, "height": height, "deviceScaleFactor": scale, "mobile": phone,
        });
        self.call("Emulation.setDeviceMetricsOverride", metrics);
        self.call(
            "Emulation.setTouchEmulationEnabled",
            json!({"enabled": phone}),
        );
        let features = json!({"features": [{"name": "prefers-color-scheme", "value": theme}]});
        self.call("Emulation.setEmulatedMedia", features);
    }

    pub fn go(&mut self, address: &str) {
        self.call("Page.navigate", json!({"url": address}));
    }

    /// What a script comes to.
    pub fn ask(&mut self, script: &str) -> Value {
        let asked = json!({"expression": script, "returnByValue": true, "awaitPromise": true});
        let mut answer = self.call("Runtime.evaluate", asked);
        assert!(answer["exceptionDetails"].is_null(), "{script}: {answer}");
        answer["result"]["value"].take()
    }

    /// Until a script says so, while `meanwhile` is done.
    pub fn until(&mut self, script: &str, mut meanwhile: impl FnMut()) {
        let end = Instant::now() + PATIENCE;
        while self.ask(script) != true {
            if Instant::now() > end {
                let text = self.ask("document.body.innerText");
                panic!("not so: {script}\n{}", text.as_str().unwrap_or_default());
            }
            meanwhile();
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn key(&mut self, down: bool, key: &str, code: &str, number: u32) {
        let kind = if down { "keyDown" } else { "keyUp" };
        let event =
            json!({"type": kind, "key": key, "code": code, "windowsVirtualKeyCode": number});
        self.call("Input.dispatchKeyEvent", event);
    }

    /// The pointer at the middle of an element: `mousePressed`, `mouseReleased`, `mouseMoved`.
    pub fn point(&mut self, kind: &str, element: &str) {
        let middle = format!(
            "(() => {{ const e = document.getElementById('{element}'); e.scrollIntoView({{block: 'nearest'}}); const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
        );
        let at = self.ask(&middle);
        let event = json!({
            "type": kind, "x": at[0], "y": at[1], "button": "left", "clickCount": 1,
        });
        self.call("Input.dispatchMouseEvent", event);
    }

    /// The page as it looks: `png` or `webp`, base64.
    pub fn picture(&mut self, format: &str) -> String {
        let mut shot = json!({"format": format});
        if format == "webp" {
            shot["quality"] = json!(86);
        }
        let picture = self.call("Page.captureScreenshot", shot);
        picture["data"].as_str().unwrap().to_owned()
    }

    /// One element of the page as it looks, base64.
    pub fn part(&mut self, element: &str, format: &str) -> String {
        let place = format!(
            "(() => {{ const b = document.getElementById('{element}').getBoundingClientRect(); return {{x: b.x, y: b.y, width: b.width, height: b.height, scale: 1}}; }})()"
        );
        let clip = self.ask(&place);
        let shot = json!({"format": format, "clip": clip});
        let picture = self.call("Page.captureScreenshot", shot);
        picture["data"].as_str().unwrap().to_owned()
    }

    /// Shows a text instead of a page.
    pub fn show(&mut self, html: &str) {
        self.go("about:blank");
        let tree = self.call("Page.getFrameTree", json!({}));
        let frame = tree["frameTree"]["frame"]["id"].clone();
        let content = json!({"frameId": frame, "html": html});
        self.call("Page.setDocumentContent", content);
    }

    /// Errors and warnings that the page's console holds.
    pub fn complaints(&self) -> Vec<&Value> {
        let complains = |event: &&Value| match event["method"].as_str() {
            Some("Log.entryAdded") => event["params"]["entry"]["level"] != "info",
            Some("Runtime.exceptionThrown" | "Runtime.consoleAPICalled") => true,
            _ => false,
        };
        self.events.iter().filter(complains).collect()
    }

    /// Every address that was asked for.
    pub fn asked_for(&self) -> Vec<&str> {
        let address = |event: &'_ Value| match event["method"].as_str() {
            Some("Network.requestWillBeSent") => Some("request"),
            Some("Network.webSocketCreated") => Some(""),
            _ => None,
        };
        self.events
            .iter()
            .filter_map(|event| match address(event)? {
                "" => event["params"]["url"].as_str(),
                _ => event["params"]["request"]["url"].as_str(),
            })
            .collect()
    }
}

/// Where its one page is talked to.
fn page_of(at: &str) -> String {
    let end = Instant::now() + PATIENCE;
    loop {
        let mut stream = TcpStream::connect(at).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(
            stream,
            "GET /json/list HTTP/1.1\r\nHost: {at}\r\nConnection: close\r\n\r\n"
        )
        .unwrap();
        let body = body(&mut stream);
        let pages: Value = serde_json::from_slice(&body).unwrap();
        let mut pages = pages.as_array().unwrap().iter();
        if let Some(page) = pages.find(|page| page["type"] == "page") {
            return page["webSocketDebuggerUrl"].as_str().unwrap().to_owned();
        }
        assert!(Instant::now() < end, "no page");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The bytes of base64.
pub fn decoded(text: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => Some(u32::from(c - b'A')),
        b'a'..=b'z' => Some(u32::from(c - b'a') + 26),
        b'0'..=b'9' => Some(u32::from(c - b'0') + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let digits: Vec<u32> = text.bytes().filter_map(digit).collect();
    let mut bytes = Vec::with_capacity(digits.len() * 3 / 4);
    for group in digits.chunks(4) {
        let bits = group.iter().fold(0, |bits, digit| bits << 6 | digit) << (6 * (4 - group.len()));
        let all = bits.to_be_bytes();
        bytes.extend_from_slice(&all[1..group.len()]);
    }
    bytes
}

/// The body of an answer on a connection that stays open.
fn body(stream: &mut TcpStream) -> Vec<u8> {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        head.extend_from_slice(&byte);
    }
    let head = String::from_utf8(head).unwrap().to_ascii_lowercase();
    let length = head
        .lines()
        .find_map(|line| line.strip_prefix("content-length:"));
    let mut body = vec![0; length.unwrap().trim().parse().unwrap()];
    stream.read_exact(&mut body).unwrap();
    body
}
