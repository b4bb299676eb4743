//! The page in a real browser without a screen: what it shows is what it was told, and what a person does there is heard.

use crate::support;

use std::collections::BTreeMap;
use std::process::Stdio;
use std::time::{Duration, Instant, SystemTime};

use gauntlet::web::picture::{Action, Axis, Clutch, Gripper, Guide, Headline, Rates, Teach, Tone};
use gauntlet::web::{self, Known, Page, Picture, Wish};
use host::glove::hand::{JOINT_COUNT, Side};
use host::glove::scan::Health;
use host::gripper::kinematics::Model;
use support::bench::{Bench, Running, ends_soon};
use support::browser::Browser;
use support::page::{OpenPage, PATIENCE, address};

/// Whether the page says that the clutch may be closed.
const OPEN: &str =
    "document.getElementById('clutch-words').textContent === 'clutch open: hold space'";
/// Whether it says that this page holds it closed.
const CLOSED: &str =
    "document.getElementById('clutch-words').textContent === 'clutch closed: let go to open'";

/// A hand bent by so much, and a gripper that is nearly there.
pub fn picture(bent: f32) -> Picture {
    let mut angles = [0.0; JOINT_COUNT];
    for finger in 1..5 {
        for joint in [0, 3, 4] {
            angles[5 * finger + joint] = bent * (1.0 - 0.12 * finger as f32);
        }
    }
    (angles[0], angles[3]) = (0.3 * bent, 0.5 * bent);
    let known = |segment: usize| Known {
        health: (segment != 11).then_some(Health::Good),
        unused: (segment == 8).then_some("heading not sure: its joint is held"),
        sigma: Some(0.02 + 0.004 * segment as f32),
    };
    let asked = [40.0, 90.0, 150.0].map(|more| (more + 70.0 * bent) as u8);
    let asked = [asked[0], asked[1], asked[2], 120];
    let reached = asked.map(|count| count - 9);
    let axes = ["finger A", "finger B", "finger C", "scissor"];
    Picture {
        title: "gauntlet teleop".to_owned(),
        elapsed_s: 12.3,
        state: Headline {
            words: "following".to_owned(),
            tone: Tone::Good,
        },
        clutch: Some(clutch("open", None)),
        hand: Some(web::drawn_hand(&angles, Side::Right, true, known)),
        gripper: Some(Gripper {
            reached: web::gripper(Model::ThreeFinger, &reached),
            asked: web::gripper(Model::ThreeFinger, &asked),
            axes: (0..4)
                .map(|k| Axis {
                    name: axes[k],
                    asked: Some(asked[k]),
                    reached: Some(reached[k]),
                    word: "moving",
                })
                .collect(),
            age_s: None,
            is_imagined: false,
        }),
        rates: Some(Rates {
            frames_per_s: 31.4,
            cycles_per_s: Some(122.5),
            latency_p50_us: Some(33_000),
            latency_p99_us: Some(46_300),
            dropped: 2,
        }),
        faults: vec!["no sample from ring_middle".to_owned()],
        actions: vec![Action {
            name: "flat",
            key: "c",
            words: "flat hand (c)".to_owned(),
        }],
        ..Picture::default()
    }
}

fn clutch(position: &'static str, page: Option<u64>) -> Clutch {
    Clutch {
        position,
        page,
        terminal: false,
        may_close: true,
    }
}

/// Shows `picture` until the script says that it is there.
fn shown(browser: &mut Browser, page: &mut Page, script: &str, picture: impl Fn() -> Picture) {
    browser.until(script, || page.show(&picture));
}

/// What was heard, until `wish` was; pictures go on.
fn heard(page: &mut Page, wish: &Wish, picture: impl Fn() -> Picture) -> Vec<Wish> {
    let end = Instant::now() + PATIENCE;
    let mut all = Vec::new();
    while !all.contains(wish) {
        assert!(Instant::now() < end, "{wish:?} was not heard: {all:?}");
        page.show(&picture);
        all.extend(page.said().map(|said| said.wish));
        std::thread::sleep(Duration::from_millis(5));
    }
    all
}

fn text(browser: &mut Browser, id: &str) -> String {
    let text = browser.ask(&format!("document.getElementById('{id}').textContent"));
    text.as_str().unwrap().to_owned()
}

/// The pixels of both bodies.
fn drawn(browser: &mut Browser) -> [String; 2] {
    ["hand", "gripper"].map(|id| {
        let picture = browser.ask(&format!("document.getElementById('{id}').toDataURL()"));
        picture.as_str().unwrap().to_owned()
    })
}

#[test]
fn a_browser_draws_what_it_is_told_fetches_nothing_else_and_says_what_a_person_does() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let mut page = Page::at("127.0.0.1:0".parse().unwrap()).unwrap();
    browser.screen((1280, 900), 1.0, "dark");
    browser.go(page.address());
    let state =
        |words: &str| format!("document.getElementById('state')?.textContent === '{words}'");
    shown(&mut browser, &mut page, &state("following"), || {
        picture(0.1)
    });
    // Numbers and words.
    let told = serde_json::to_value(picture(0.1)).unwrap();
    for (k, axis) in told["gripper"]["axes"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
    {
        let row = browser.ask(&format!(
            "document.querySelectorAll('#axes .number')[{k}].firstChild.textContent"
        ));
        assert_eq!(row, format!("{} → {}", axis["asked"], axis["reached"]));
    }
    shown(
        &mut browser,
        &mut page,
        "document.getElementById('frames').textContent === '31.4/s'",
        || picture(0.1),
    );
    assert_eq!(text(&mut browser, "cycles"), "122.5/s");
    assert_eq!(text(&mut browser, "latency"), "46.3 ms");
    assert_eq!(text(&mut browser, "faults"), "no sample from ring_middle");
    assert!(text(&mut browser, "sensors-words").starts_with("14 of 16 good"));
    assert_eq!(
        text(&mut browser, "clutch-words"),
        "clutch open: hold space"
    );
    let live = browser.ask("document.getElementById('live').getAttribute('aria-live')");
    assert_eq!(live, "polite");
    browser
        .ask("document.querySelectorAll('#sensors-panel details').forEach((d) => (d.open = true))");
    let angle = "document.querySelector('#angles').rows[1]?.cells[1].textContent";
    let expected = format!("{:.1}", told["hand"]["angles_deg"][5].as_f64().unwrap());
    shown(
        &mut browser,
        &mut page,
        &format!("{angle} === '{expected}'"),
        || picture(0.1),
    );
    // Both bodies move with it.
    let before = drawn(&mut browser);
    let now = |bent: f32| {
        let angles = serde_json::to_value(picture(bent)).unwrap();
        let angle_deg = angles["hand"]["angles_deg"][5].as_f64().unwrap();
        format!("{angle} === '{angle_deg:.1}'")
    };
    shown(&mut browser, &mut page, &now(0.9), || picture(0.9));
    let after = drawn(&mut browser);
    assert!(
        before[0] != after[0] && before[1] != after[1],
        "nothing moved"
    );
    shown(&mut browser, &mut page, &now(0.1), || picture(0.1));
    assert!(before == drawn(&mut browser), "the same looks the same");
    // The mirror.
    browser.key(true, "m", "KeyM", 77);
    let mirrored = "document.getElementById('hand-name').textContent === 'right hand, mirrored'";
    shown(&mut browser, &mut page, mirrored, || picture(0.1));
    // The clutch: by key, and by button.
    page.said().for_each(drop);
    browser.key(true, " ", "Space", 32);
    let wishes = heard(&mut page, &Wish::Beat, || picture(0.1));
    assert_eq!(wishes[0], Wish::Close);
    let closed = || Picture {
        clutch: Some(clutch("closed", Some(1))),
        ..picture(0.1)
    };
    shown(&mut browser, &mut page, CLOSED, closed);
    browser.key(false, " ", "Space", 32);
    heard(&mut page, &Wish::Open, closed);
    shown(&mut browser, &mut page, OPEN, || picture(0.1));
    browser.point("mousePressed", "clutch");
    let wishes = heard(&mut page, &Wish::Beat, || picture(0.1));
    assert_eq!(wishes[0], Wish::Close, "{wishes:?}");
    browser.point("mouseReleased", "clutch");
    heard(&mut page, &Wish::Open, || picture(0.1));
    // What is held down while the clutch is said to be open closes nothing for long.
    browser.key(true, " ", "Space", 32);
    heard(&mut page, &Wish::Close, || picture(0.1));
    shown(&mut browser, &mut page, OPEN, || picture(0.1));
    browser.key(false, " ", "Space", 32);
    // An action, and Escape.
    browser.key(true, "c", "KeyC", 67);
    heard(&mut page, &Wish::Do("flat".to_owned()), || picture(0.1));
    page.said().for_each(drop);
    browser.key(true, "Escape", "Escape", 27);
    heard(&mut page, &Wish::Open, || picture(0.1));
    assert!(
        browser.complaints().is_empty(),
        "{:?}",
        browser.complaints()
    );
    let at = page.address().strip_prefix("http://").unwrap().to_owned();
    for asked in browser.asked_for() {
        let own = asked
            .split_once("://")
            .is_some_and(|(_, rest)| rest.starts_with(&at));
        assert!(own || asked.starts_with("data:"), "asked for {asked}");
    }
    // A page that is left is gone at once.
    page.said().for_each(drop);
    browser.go("about:blank");
    heard(&mut page, &Wish::Gone, || picture(0.1));
}

#[test]
fn a_person_at_a_browser_drives_the_gripper_sees_where_it_is_and_by_leaving_the_page_holds_it() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let bench = Bench::new(&[]);
    let mut words = bench.arguments();
    words.push("--view");
    let mut running = Running::start(
        support::command(&words)
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit()),
    );
    let address = address(running.0.stdout.take().unwrap());
    browser.screen((1280, 900), 1.0, "dark");
    browser.go(&address);
    let state =
        |words: &str| format!("document.getElementById('state')?.textContent === '{words}'");
    // Without a calibration it would say so instead.
    browser.until(&state("idle"), || {});
    browser.until(OPEN, || {});
    browser
        .ask("document.querySelectorAll('#sensors-panel details').forEach((d) => (d.open = true))");
    browser.key(true, " ", "Space", 32);
    browser.until(&state("following"), || {});
    let before = drawn(&mut browser);
    let begin = bench.gripper.positions();
    bench.hand_moves();
    // Farther than a flat hand seems to move by the noise of its sensors.
    let bent = "parseFloat(document.querySelector('#angles').rows[1]?.cells[1].textContent) > 20";
    let moved = |now: [f32; 4]| begin.iter().zip(now).any(|(a, b)| (a - b).abs() > 8.0);
    let end = Instant::now() + PATIENCE;
    while !moved(bench.gripper.positions()) || browser.ask(bent) != true {
        assert!(Instant::now() < end, "{:?}", bench.gripper.positions());
        std::thread::sleep(Duration::from_millis(10));
    }
    let after = drawn(&mut browser);
    assert!(before[0] != after[0], "the hand is drawn as it was");
    assert!(before[1] != after[1], "the gripper is drawn as it was");
    // Kept to be found in the log, once there is one.
    let reached = "document.querySelector('#axes .number').firstChild.textContent.split(' → ')[1]";
    let mut seen: Vec<f64> = Vec::new();
    while seen.len() < 12 {
        assert!(Instant::now() < end, "finger A stands: {seen:?}");
        let number = browser.ask(reached);
        let number: Option<f64> = number.as_str().and_then(|number| number.parse().ok());
        if seen.last().copied() != number {
            seen.extend(number);
        }
    }
    assert!(
        browser.complaints().is_empty(),
        "{:?}",
        browser.complaints()
    );
    let mut other = OpenPage::open(&address);
    other.until("held in the browser", |page| page.clutch() == "closed");
    browser.until(CLOSED, || {});
    let closed = SystemTime::now();
    browser.go("about:blank");
    // Opened, not run out.
    other.until("opened", |page| matches!(page.clutch(), "open" | "expired"));
    assert_eq!(other.clutch(), "open");
    // The end of a run is a hold, too: not the one that is looked for.
    std::thread::sleep(Duration::from_millis(600));
    support::interrupt(&running.0);
    ends_soon(&mut running.0);
    bench.assert_held_within_half_a_second_of(closed);
    bench.assert_logged(&seen);
}

/// Every state that the page knows, at the width of a desk and of a phone, as pictures to look at: `PAGE_PICTURES` names the folder.
#[test]
#[ignore = "makes pictures: cargo xtask pictures"]
fn screenshots_of_every_state() {
    let folder = std::env::var_os("PAGE_PICTURES").expect("PAGE_PICTURES names a folder");
    let folder = std::path::PathBuf::from(folder);
    let mut browser = Browser::start().expect("chromium");
    let mut page = Page::at("127.0.0.1:0".parse().unwrap()).unwrap();
    browser.screen((1280, 900), 1.0, "dark");
    browser.go(page.address());
    for (name, picture) in states() {
        let words = picture.state.words.clone();
        let there = format!("document.getElementById('state')?.textContent === '{words}'");
        for (size, width, scale, theme) in [
            ("desk", (1280, 900), 1.0, "dark"),
            ("desk-light", (1280, 900), 1.0, "light"),
            ("phone", (375, 812), 2.0, "dark"),
        ] {
            browser.screen(width, scale, theme);
            shown(&mut browser, &mut page, &there, || picture.clone());
            let end = Instant::now() + Duration::from_millis(600);
            while Instant::now() < end {
                page.show(|| picture.clone());
                std::thread::sleep(Duration::from_millis(15));
            }
            let wide = browser.ask("document.documentElement.scrollWidth <= window.innerWidth");
            assert_eq!(wide, true, "{name} is wider than {size}");
            let png = support::browser::decoded(&browser.picture("png"));
            std::fs::write(folder.join(format!("{name}-{size}.png")), png).unwrap();
        }
    }
    assert!(
        browser.complaints().is_empty(),
        "{:?}",
        browser.complaints()
    );
}

/// The README's picture: the page of a demo, and three moments of it. Where `PAGE_PICTURES` is set, like all that is only made to look at.
#[test]
#[ignore = "makes pictures: cargo xtask pictures"]
fn film_strip_of_the_demo() {
    let mut words = vec!["demo", "--view", "--seconds", "60", "--seed", "3"];
    words.push("--json");
    let mut running = support::bench::Running::start(
        support::command(&words)
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::piped()),
    );
    let address = support::page::address(running.0.stderr.take().unwrap());
    let mut browser = Browser::start().expect("chromium");
    browser.screen((1280, 930), 1.5, "dark");
    browser.go(&address);
    let end = Instant::now() + Duration::from_secs(600);
    let following = "document.getElementById('state')?.textContent === 'following'";
    while browser.ask(following) != true {
        assert!(Instant::now() < end, "the demo does not follow");
        std::thread::sleep(Duration::from_millis(200));
    }
    // A moment in which much is bent, one in which little is; the plots fill meanwhile.
    std::thread::sleep(Duration::from_secs(12));
    let whole = browser.picture("png");
    let moments: Vec<String> = (0..3)
        .map(|_| {
            std::thread::sleep(Duration::from_millis(1_900));
            browser.part("stages", "png")
        })
        .collect();
    support::interrupt(&running.0);
    let rows: Vec<String> = moments
        .iter()
        .map(|png| format!("<img width=413 src='data:image/png;base64,{png}'>"))
        .collect();
    let sheet = format!(
        "<body style='margin:0;background:#0e1116;width:1280px'><img id=first width=1280 src='data:image/png;base64,{whole}'><div style='display:flex;justify-content:space-between;padding:12px 10px 14px'>{}</div></body>",
        rows.join("")
    );
    browser.show(&sheet);
    browser.until(
        "[...document.images].every((image) => image.complete && image.naturalWidth)",
        || {},
    );
    let height = browser.ask("document.body.scrollHeight").as_u64().unwrap();
    browser.screen((1280, height.try_into().unwrap()), 1.0, "dark");
    let webp = support::browser::decoded(&browser.picture("webp"));
    assert!(webp.len() < 500_000, "{} bytes", webp.len());
    let docs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/view.webp");
    std::fs::write(docs, webp).unwrap();
    support::bench::ends_soon(&mut running.0);
}

fn states() -> BTreeMap<&'static str, Picture> {
    let headline = |words: &str, tone| Headline {
        words: words.to_owned(),
        tone,
    };
    let teach = Teach {
        round: 3,
        rounds: 8,
        target: web::gripper(Model::ThreeFinger, &[0, 255, 180, 30]),
        target_counts: vec![0, 255, 180, 30],
        words: "hold still".to_owned(),
        held: 0.62,
        countdown: Some(2),
        said: Some("pose 2 taken".to_owned()),
        refused: None,
    };
    let guide = Guide {
        part: 2,
        parts: 12,
        name: "turn".to_owned(),
        words: "Turn the hand all ways, flat like a board.".to_owned(),
        turning: Some("fingers up"),
        drawing: "",
        left_s: 6.1,
        left: 0.47,
        counts: true,
        remarks: vec!["turn further, all ways".to_owned()],
        bends_deg: vec![0.0; 5],
        end: Vec::new(),
    };
    BTreeMap::from([
        (
            "following",
            Picture {
                faults: Vec::new(),
                clutch: Some(clutch("closed", Some(1))),
                ..picture(0.7)
            },
        ),
        (
            "open",
            Picture {
                state: headline("idle", Tone::Calm),
                ..picture(0.2)
            },
        ),
        (
            "lost",
            Picture {
                state: headline("held: the heartbeat is missing", Tone::Wait),
                clutch: Some(clutch("lost", Some(1))),
                ..picture(0.5)
            },
        ),
        (
            "expired",
            Picture {
                state: headline("held: nobody keeps the clutch closed", Tone::Wait),
                clutch: Some(clutch("expired", None)),
                ..picture(0.5)
            },
        ),
        (
            "teaching",
            Picture {
                title: "gauntlet train --live".to_owned(),
                state: headline("hold still", Tone::Wait),
                clutch: None,
                teach: Some(teach),
                faults: Vec::new(),
                ..picture(0.8)
            },
        ),
        (
            "calibrating",
            Picture {
                title: "gauntlet calibrate".to_owned(),
                state: headline("measuring", Tone::Good),
                clutch: None,
                gripper: None,
                rates: None,
                guide: Some(guide),
                faults: Vec::new(),
                ..picture(0.0)
            },
        ),
    ])
}
