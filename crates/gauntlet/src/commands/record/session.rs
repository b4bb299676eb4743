//! The recording itself: prompts, rows, how it goes.

use std::sync::mpsc::{SyncSender, TrySendError};
use std::time::{Duration, Instant};

use host::glove::hand::{JOINT_COUNT, Side};

use crate::out;
use crate::progress::Progress;
use crate::results::gloves;
use crate::web::picture::{Guide, Headline, Tone};
use crate::web::{self, Page, Picture};
use host::clock::QuietTime;
use host::interrupt::Interrupt;
use host::recording::poses::Row;
use host::scanning::{Hand, Scanned, Scanning};
use host::session::record::{Feed, Frame, Record};
use host::stats::short_or_dash;
use host::training::movements::Movements;
use host::training::prompts::{GUIDED, Prompt, again, free};
use host::training::recorded::names;

/// Pause between two looks.
const ROUND: Duration = Duration::from_millis(20);
/// A glove that is silent for so long ends the recording; unplugged and plugged in again it goes on before.
const SILENT: Duration = Duration::from_secs(10);

/// What ended it before its time.
pub(super) enum Gone {
    /// No scan came.
    Silent,
    /// The headings are lost.
    NotCalibrated,
    /// The reading, or the writing, ended.
    Ended(anyhow::Error),
}

/// What is left of it.
pub(super) struct Done {
    /// Scans that are no row.
    pub passed_over: u64,
    pub scanned: gloves::Scanned,
}

/// A recording under way.
pub(super) struct Session {
    scanning: Scanning,
    hand: Hand,
    rows: SyncSender<Row>,
    quiet: bool,
    first: Option<host::glove::Instant>,
    written: u64,
    passed_over: u64,
    movements: Movements,
    quiet_time: QuietTime,
    /// The page, and whose hand it shows.
    page: Option<Page>,
    side: Side,
    began: Instant,
    angles: [f32; JOINT_COUNT],
    /// Where scans are logged.
    feed: Option<Feed>,
}

impl Session {
    pub fn new(scanning: Scanning, hand: Hand, rows: SyncSender<Row>, quiet: bool) -> Self {
        scanning.waiting().for_each(drop);
        scanning.begin();
        Self {
            scanning,
            hand,
            rows,
            quiet,
            first: None,
            written: 0,
            passed_over: 0,
            movements: Movements::default(),
            quiet_time: QuietTime::begin(),
            page: None,
            side: Side::Right,
            began: Instant::now(),
            angles: [0.0; JOINT_COUNT],
            feed: None,
        }
    }

    /// Hands every scan to a log, too.
    pub fn keeps(&mut self, feed: Option<Feed>) {
        self.feed = feed;
    }

    /// Shows all of it on `page`, too.
    pub fn shows(&mut self, page: Option<Page>, side: Side) {
        (self.page, self.side) = (page, side);
    }

    /// Movement after movement, and what was not seen once more.
    pub fn guided(&mut self, interrupt: &Interrupt) -> Result<(), Gone> {
        if !self.ask(&GUIDED, interrupt)? {
            return Ok(());
        }
        let more = again(&self.movements.missing());
        if !more.is_empty() {
            self.ask(&more, interrupt)?;
        }
        Ok(())
    }

    /// Without prompts.
    pub fn free(&mut self, time: Duration, interrupt: &Interrupt) -> Result<(), Gone> {
        self.ask(&[free(time)], interrupt).map(drop)
    }

    /// Asks for all of these. Returns whether to go on: not when somebody asked for the end.
    fn ask(&mut self, prompts: &[Prompt], interrupt: &Interrupt) -> Result<bool, Gone> {
        let total: Duration = prompts.iter().map(|prompt| prompt.time).sum();
        let ms = |time: Duration| u64::try_from(time.as_millis()).unwrap_or(u64::MAX);
        let mut progress = Progress::start("recording", ms(total), false);
        let mut before = Duration::ZERO;
        for (k, prompt) in prompts.iter().enumerate() {
            progress.say(&format!(
                "{:>2} of {}   {}   ({} s)",
                k + 1,
                prompts.len(),
                prompt.ask,
                prompt.time.as_secs()
            ));
            let began = Instant::now();
            while began.elapsed() < prompt.time {
                self.round(interrupt)?;
                let unseen = !self.quiet && out::reader_left().map_err(Gone::Ended)?;
                if interrupt.asked() || unseen {
                    return Ok(false);
                }
                let done = before + began.elapsed().min(prompt.time);
                self.show(prompt, (k + 1, prompts.len()), began.elapsed());
                progress.at_with(ms(done), Some(total.saturating_sub(done)), || self.detail());
            }
            before += prompt.time;
            let missing: Vec<_> = self
                .movements
                .missing()
                .into_iter()
                .filter(|movement| prompt.shows.contains(movement))
                .collect();
            if !missing.is_empty() {
                progress.say(&format!("          not seen: {}", names(&missing)));
            }
        }
        Ok(true)
    }

    /// Takes what came.
    fn round(&mut self, interrupt: &Interrupt) -> Result<(), Gone> {
        let mut scanned = self.scanning.next(ROUND);
        while let Some(scan) = scanned {
            self.take(&scan, interrupt);
            scanned = self.scanning.next(Duration::ZERO);
        }
        if !self.scanning.running() {
            return Err(Gone::Ended(self.scanning.ended()));
        }
        if self.quiet_time.look() >= SILENT {
            return Err(Gone::Silent);
        }
        match self.hand.is_calibrated() {
            true => Ok(()),
            false => Err(Gone::NotCalibrated),
        }
    }

    fn take(&mut self, scan: &Scanned, interrupt: &Interrupt) {
        self.quiet_time.end();
        let pose = self.hand.take(scan);
        self.angles = pose.angles;
        if let Some(feed) = &self.feed {
            let calibrated = self.hand.is_calibrated();
            let angles = calibrated.then_some((pose.angles, pose.held));
            let frame = Frame::of_scan(scan.at, &scan.frame, angles, self.hand.headings());
            feed.hand(Record::Frame(Box::new(frame)));
        }
        if !pose.is_whole() {
            self.passed_over += 1;
            return;
        }
        let first = *self.first.get_or_insert(pose.at);
        let since = pose.at.checked_duration_since(first);
        let row = Row {
            at_us: since.map_or(0, |since| since.as_ticks()),
            angles: pose.angles,
        };
        match self.rows.try_send(row) {
            Ok(()) => {
                self.written += 1;
                self.movements.take(&pose.angles);
            }
            // The disk is slow.
            Err(TrySendError::Full(_)) => self.passed_over += 1,
            // The writer has ended; it tells why.
            Err(TrySendError::Disconnected(_)) => interrupt.ask(),
        }
    }

    /// Shows what is asked for, and what comes of it.
    fn show(&mut self, prompt: &Prompt, (part, parts): (usize, usize), elapsed: Duration) {
        let Some(mut page) = self.page.take_if(|page| page.is_due()) else {
            return;
        };
        let seen = self.scanning.snapshot();
        let left = prompt.time.saturating_sub(elapsed);
        let (calibrated, sigma) = (self.hand.is_calibrated(), self.hand.headings());
        let hand = web::scanned_hand(
            &self.angles,
            self.side,
            calibrated,
            seen.as_ref(),
            sigma.map(|known| known.sigma),
        );
        page.show(|| Picture {
            title: "gauntlet record".to_owned(),
            elapsed_s: self.began.elapsed().as_secs_f64(),
            state: Headline {
                words: format!("recording: {} poses", self.written),
                tone: Tone::Good,
            },
            hand: Some(hand),
            rates: seen.as_ref().map(web::scan_rates),
            guide: Some(Guide {
                part,
                parts,
                name: "do this".to_owned(),
                words: prompt.ask.to_owned(),
                left_s: left.as_secs_f32(),
                left: left.as_secs_f32() / prompt.time.as_secs_f32().max(1e-3),
                counts: true,
                remarks: vec![self.detail()],
                ..Guide::default()
            }),
            ..Picture::default()
        });
        self.page = Some(page);
    }

    /// How it goes, in a line.
    fn detail(&self) -> String {
        let missing = self.movements.missing();
        let missing = match missing.len() {
            0 => "every movement seen".to_owned(),
            _ => format!("not yet: {}", names(&missing)),
        };
        let Some(seen) = self.scanning.snapshot() else {
            return missing;
        };
        format!(
            "{} poses, {:.0}/s, jitter {}, dropped {}, {} of 16 good; {missing}",
            self.written,
            seen.rate,
            short_or_dash(seen.jitter_us),
            self.passed_over + seen.not_taken,
            seen.good()
        )
    }

    /// Ends the reading.
    pub fn finish(mut self) -> Done {
        let snapshot = self.scanning.snapshot();
        // What ended it before was told.
        let _ = self.scanning.stop();
        Done {
            passed_over: self.passed_over,
            scanned: snapshot.as_ref().map(Into::into).unwrap_or_default(),
        }
    }
}
