//! The page: who may open it, who holds the clutch there, and what opens it.

use crate::support;

use std::process::Stdio;
use std::time::{Duration, Instant, SystemTime};

use gauntlet::web::picture::Headline;
use gauntlet::web::{Page, Picture, Wish};
use rustix::process::Signal;
use support::bench::{Bench, Running, ends_soon, send};
use support::page::{OpenPage, address, answer, parts};
use support::{command, interrupt, tool};

fn served() -> Page {
    Page::at("127.0.0.1:0".parse().unwrap()).unwrap()
}

fn titled(title: String) -> Picture {
    Picture {
        title,
        state: Headline::default(),
        ..Picture::default()
    }
}

#[test]
fn the_page_is_served_under_its_whole_address_and_to_no_other_name() {
    let page = served();
    let (at, path) = parts(page.address());
    let get = |host: &str, path: &str| {
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        answer(at, &request)
    };
    for file in ["", "view.js", "bodies.js", "style.css"] {
        let (status, rest) = get(at, &format!("{path}{file}"));
        assert!(status.contains("200"), "{file}: {status}");
        let rest = rest.to_ascii_lowercase();
        for header in ["default-src 'none'", "no-store", "no-referrer", "nosniff"] {
            assert!(rest.contains(header), "{file}: no {header}");
        }
        // Nothing is fetched from anywhere else.
        let body = rest.split_once("\r\n\r\n").unwrap().1;
        let body = body.replace("http://www.w3.org/2000/svg", "");
        assert!(
            !body.contains("http:") && !body.contains("https:"),
            "{file}"
        );
    }
    let port = at.split_once(':').unwrap().1;
    for (host, path) in [
        (at, "/"),
        (at, "/view.js"),
        (at, "/0123456789abcdef0123456789abcdef/"),
        (&format!("evil.example:{port}"), path),
        ("127.0.0.1", path),
        ("", path),
    ] {
        let (status, body) = get(host, path);
        assert!(status.contains("403"), "{host} {path}: {status}");
        assert!(body.contains("address that gauntlet printed"), "{body}");
    }
    let twice =
        format!("GET {path} HTTP/1.1\r\nHost: {at}\r\nHost: {at}\r\nConnection: close\r\n\r\n");
    assert!(!answer(at, &twice).0.contains("200"), "two hosts");
    let whole = format!(
        "GET http://evil.example{path} HTTP/1.1\r\nHost: {at}\r\nConnection: close\r\n\r\n"
    );
    assert!(
        !answer(at, &whole).0.contains("200"),
        "a host in the request line"
    );
    let post = format!("POST {path} HTTP/1.1\r\nHost: {at}\r\nConnection: close\r\n\r\n");
    assert!(answer(at, &post).0.contains("405"));
}

#[test]
fn a_websocket_without_the_token_or_from_a_foreign_page_is_refused() {
    let page = served();
    let (at, _) = parts(page.address());
    assert!(OpenPage::from(page.address(), Some(&format!("http://{at}"))).is_ok());
    let port = at.split_once(':').unwrap().1;
    for origin in [
        None,
        Some("null".to_owned()),
        Some("http://evil.example".to_owned()),
        Some(format!("http://localhost:{port}")),
        Some(format!("https://{at}")),
    ] {
        let refused = OpenPage::from(page.address(), origin.as_deref());
        assert_eq!(refused.err(), Some(403), "{origin:?}");
    }
    let bare = format!("http://{at}/0123456789abcdef0123456789abcdef/");
    let refused = OpenPage::from(&bare, Some(&format!("http://{at}")));
    assert_eq!(refused.err(), Some(403));
}

#[test]
fn a_page_that_was_slow_gets_the_newest_picture_and_none_of_those_between() {
    let mut page = served();
    let mut slow = OpenPage::open(page.address());
    page.show(|| titled("first".to_owned()));
    slow.until("the first picture", |slow| slow.picture["title"] == "first");
    // It was asked for: one more may be under way.
    let mut shown = 0;
    while shown < 50 {
        if page.is_due() {
            shown += 1;
            page.show(|| titled(shown.to_string()));
        }
        std::thread::yield_now();
    }
    slow.until("the newest", |slow| slow.picture["title"] == "50");
    assert!(slow.pictures <= 4, "{} pictures", slow.pictures);
}

/// The short form of the hour's soak (`cargo xtask campaign view`).
#[test]
fn a_page_that_asks_for_every_picture_and_reads_none_costs_no_memory_and_another_sees_the_newest() {
    const PICTURES: usize = 300;
    const LONG: usize = 400_000;
    let mut page = served();
    let mut reader = OpenPage::open(page.address());
    let mut greedy = OpenPage::open(page.address());
    let mut early = 0;
    for number in 1..=PICTURES {
        while !page.is_due() {
            reader.look().unwrap();
        }
        page.show(|| titled(format!("{number} {}", "x".repeat(LONG))));
        greedy.say("ready");
        if number == PICTURES / 5 {
            early = resident_kb(std::process::id());
        }
    }
    let late = resident_kb(std::process::id());
    let shown = u64::try_from(PICTURES * LONG / 1_000).unwrap();
    assert!(
        early > 0 && late < early + shown / 3,
        "{early} kB, then {late} kB"
    );
    let newest = format!("{PICTURES} ");
    reader.until("the newest", |page| {
        page.picture["title"]
            .as_str()
            .is_some_and(|title| title.starts_with(&newest))
    });
}

/// What a process takes of memory, kB; 0 where it has ended.
fn resident_kb(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let number = line.and_then(|line| line.split_whitespace().nth(1));
    number.and_then(|kb| kb.parse().ok()).unwrap_or(0)
}

#[test]
fn a_page_that_says_too_much_or_what_means_nothing_is_told_to_go_and_the_program_hears_that_it_went()
 {
    let page = served();
    for (text, times, why) in [
        ("{\"is\":\"beat\"}".to_owned(), 400, "messages in a second"),
        ("{\"is\":\"engage\"}".to_owned(), 1, "means nothing"),
        ("no words".to_owned(), 1, "means nothing"),
    ] {
        let mut open = OpenPage::open(page.address());
        (0..times).for_each(|_| open.raw(text.clone()));
        let told = open.until_closed().unwrap_or_default();
        assert!(told.contains(why), "{told}");
        let heard: Vec<_> = page.said().collect();
        let last = heard.last().unwrap();
        assert_eq!((last.page, &last.wish), (open.id, &Wish::Gone));
        assert!(heard.len() <= 64, "{}", heard.len());
    }
    let mut long = OpenPage::open(page.address());
    long.raw(format!(
        "{{\"is\":\"do\",\"what\":\"{}\"}}",
        "x".repeat(600)
    ));
    long.until_closed();
}

#[test]
fn eight_pages_may_be_open_and_the_end_of_the_program_is_said_on_each() {
    let page = served();
    let mut open: Vec<_> = (0..8).map(|_| OpenPage::open(page.address())).collect();
    assert_eq!(page.watching(), 8);
    let (at, _) = parts(page.address());
    let address = page.address().to_owned();
    let ninth =
        std::panic::catch_unwind(|| OpenPage::from(&address, Some(&format!("http://{at}"))));
    assert!(ninth.is_err(), "a ninth page was greeted");
    drop(page);
    for open in &mut open {
        assert_eq!(
            open.until_closed().as_deref(),
            Some("the program has ended")
        );
    }
}

/// A run with a page, and the page's address.
fn run(bench: &Bench) -> (Running, String) {
    let mut words = bench.arguments();
    words.push("--view");
    let mut running = Running::start(
        command(&words)
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit()),
    );
    let address = address(running.0.stdout.take().unwrap());
    (running, address)
}

#[test]
fn one_page_holds_the_clutch_and_closing_it_opens_the_clutch_which_nobody_else_holds_then() {
    let bench = Bench::new(&[]);
    let (mut running, address) = run(&bench);
    let mut holder = OpenPage::open(&address);
    let mut other = OpenPage::open(&address);
    let calibrated = |page: &OpenPage| {
        page.clutch() == "open"
            && page.picture["clutch"]["may_close"] == true
            && page.picture["hand"]["calibrated"] == true
    };
    holder.until("ready to follow", calibrated);
    // Heartbeats close nothing, nor does a press on a picture that is long gone.
    holder.say("beat");
    holder.say_of("close", 0);
    let number = holder.number;
    holder.until("some pictures later", |page| page.number > number + 20);
    assert_eq!(holder.clutch(), "open");
    holder.say("close");
    holder.until_holding("held", OpenPage::holds);
    bench.hand_moves();
    let begin = bench.gripper.positions();
    let moved = |now: [f32; 4]| begin.iter().zip(now).any(|(a, b)| (a - b).abs() > 8.0);
    holder.until_holding("moving", |_| moved(bench.gripper.positions()));
    // What the page shows is what the gripper does.
    let reached = |page: &OpenPage| {
        page.picture["gripper"]["axes"][0]["reached"]
            .as_f64()
            .unwrap()
    };
    let shown = reached(&holder);
    let truth = f64::from(bench.gripper.positions()[0]);
    assert!((shown - truth).abs() < 60.0, "{shown} {truth}");
    // Kept to be found in the log, once there is one.
    let mut seen = Vec::new();
    for _ in 0..12 {
        let number = holder.number;
        holder.until_holding("the next picture", |page| page.number > number);
        seen.push(reached(&holder));
    }
    seen.dedup();
    assert_eq!(
        holder.picture["gripper"]["reached"]
            .as_array()
            .unwrap()
            .len(),
        16
    );
    assert_eq!(
        holder.picture["hand"]["sensors"].as_array().unwrap().len(),
        16
    );
    // Another page can neither take it nor keep it.
    let id = holder.id;
    other.until("seen by the other", |page| {
        page.picture["clutch"]["page"] == id
    });
    other.say("close");
    other.say("beat");
    let number = holder.number;
    holder.until_holding("later", |page| page.number > number + 10);
    assert!(holder.holds(), "{}", holder.picture["clutch"]);
    let closed = SystemTime::now();
    drop(holder);
    // Opened, not run out: that is what `open` means and not `expired`.
    other.until("opened", |page| matches!(page.clutch(), "open" | "expired"));
    assert_eq!(other.clutch(), "open");
    assert_eq!(other.picture["clutch"]["page"], serde_json::Value::Null);
    // And now the other one may; anybody may open it.
    other.say("close");
    other.until_holding("held by the other", OpenPage::holds);
    let mut third = OpenPage::open(&address);
    third.until("seen by the third", |page| page.clutch() == "closed");
    third.say("open");
    other.until_holding("opened by the third", |page| page.clutch() == "open");
    interrupt(&running.0);
    assert_eq!(
        other.until_closed().as_deref(),
        Some("the program has ended")
    );
    ends_soon(&mut running.0);
    // What docs/view.md promises of a page that is closed.
    bench.assert_held_within_half_a_second_of(closed);
    // The page's numbers are the log's, one after the other.
    bench.assert_logged(&seen);
}

#[test]
fn a_page_that_only_lies_open_is_nobody_who_could_close_the_clutch_again() {
    for used in [false, true] {
        let bench = Bench::new(&["--engage"]);
        let (mut running, address) = run(&bench);
        let mut page = OpenPage::open(&address);
        bench.until_moving(&mut running.0);
        page.until("closed by --engage", |page| page.clutch() == "closed");
        // Neither changes anything, but a press says that somebody is there.
        page.say(if used { "close" } else { "beat" });
        let number = page.number;
        page.until("some pictures later", |page| page.number > number + 5);
        send(&running.0, Signal::STOP);
        std::thread::sleep(Duration::from_millis(1_500));
        send(&running.0, Signal::CONT);
        page.until("opened for want of a heartbeat", |page| {
            page.clutch() == "expired"
        });
        // The glove's frames are there again by then.
        let number = page.number;
        page.until("a second later", |page| page.number > number + 60);
        interrupt(&running.0);
        // Who was there knew of it; a run by itself did not do its work.
        let code = if used { 0 } else { 1 };
        assert_eq!(ends_soon(&mut running.0), Some(code), "used: {used}");
    }
}

#[test]
fn a_page_that_is_no_longer_heard_holds_at_first_then_the_clutch_opens_by_itself_and_both_are_said()
{
    let bench = Bench::new(&[]);
    let (mut running, address) = run(&bench);
    let mut holder = OpenPage::open(&address);
    holder.until("ready to follow", |page| {
        page.clutch() == "open" && page.picture["hand"]["calibrated"] == true
    });
    holder.say("close");
    holder.until_holding("held", OpenPage::holds);
    holder.until("lost", |page| page.clutch() == "lost");
    // It is heard again before the second is over: it goes on.
    holder.say("beat");
    holder.until_holding("held again", OpenPage::holds);
    // Heartbeats on pictures that are long gone are none.
    let old = holder.number;
    holder.until_holding("later", |page| page.number > old + 40);
    let mut seen = Vec::new();
    let end = std::time::Instant::now() + support::page::PATIENCE;
    while seen.last().map(String::as_str) != Some("expired") {
        assert!(std::time::Instant::now() < end, "{seen:?}");
        holder.look().unwrap();
        holder.say_of("beat", old);
        if seen.last().map(String::as_str) != Some(holder.clutch()) {
            seen.push(holder.clutch().to_owned());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(seen, ["closed", "lost", "expired"]);
    holder.until("said", |page| {
        page.picture["faults"]
            .to_string()
            .contains("the page that held it was not heard")
    });
    // A heartbeat closes nothing; a person does.
    holder.say("beat");
    let number = holder.number;
    holder.until_holding("later", |page| page.number > number + 20);
    assert_eq!(holder.clutch(), "expired");
    holder.say("close");
    holder.until_holding("held by an act", OpenPage::holds);
    holder.say("open");
    holder.until("open", |page| page.clutch() == "open");
    interrupt(&running.0);
    holder.until_closed();
    ends_soon(&mut running.0);
}

/// A minute of a page that asks for every picture it can get.
#[derive(Debug, Default)]
struct Minute {
    /// Memory of the run, kB, at its end.
    resident_kb: u64,
    pictures: u64,
    /// The longest that a picture was waited for.
    longest: Duration,
}

/// A run that follows a hand for so many seconds in front of a page, minute by minute.
fn watched(seconds: u32) -> Vec<Minute> {
    let time = seconds.to_string();
    let bench = Bench::new(&["--engage", "--view", "--json", "--seconds", &time]);
    let mut running = Running::start(
        tool(&bench.arguments())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    let mut page = OpenPage::open(&address(running.0.stderr.take().unwrap()));
    bench.until_moving(&mut running.0);
    let begun = Instant::now();
    let mut minutes: Vec<Minute> = Vec::new();
    let mut asked = begun;
    while page.look().is_ok() {
        let now = Instant::now();
        let minute = (now - begun).as_secs() as usize / 60;
        minutes.resize_with(minutes.len().max(minute + 1), Minute::default);
        let minute = &mut minutes[minute];
        minute.pictures += 1;
        minute.longest = minute.longest.max(now - asked);
        asked = now;
        minute.resident_kb = minute.resident_kb.max(resident_kb(running.0.id()));
    }
    let output = running.finish();
    // The page may be told to go, or the run fail: then less was watched than was to be.
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(output.status.success(), "{said}");
    assert!(
        begun.elapsed() > Duration::from_secs(u64::from(seconds) - 20),
        "{said}"
    );
    minutes
}

/// What it costs the loop: `log_cost`.
#[test]
#[ignore = "an hour, or PAGE_SOAK seconds: cargo xtask campaign view"]
fn an_hour_of_a_page_costs_no_memory_and_no_time() {
    let soak = std::env::var("PAGE_SOAK").ok();
    let minutes = watched(soak.map_or(3_600, |seconds| seconds.parse().unwrap()));
    for (number, minute) in minutes.iter().enumerate() {
        println!("minute {number}: {minute:?}");
    }
    // The last one is not whole.
    let [first, .., last, _] = &minutes[..] else {
        panic!("too short: {minutes:?}");
    };
    assert!(last.resident_kb < first.resident_kb + 8_192, "memory grows");
    assert!(
        10 * last.pictures > 9 * first.pictures,
        "pictures come slower"
    );
}
