//! The demo's virtual person gets its profile: from the guided session on the virtual clock or in real time, or from a file.

use anyhow::Result;
use host::glove::calibration::Bound;
use rig::glove::VirtualGlove;

use super::parts::{Stage, Virtual};
use crate::commands::calibrate::session::{Leading, Led, Session};
use crate::commands::calibrate::source::Source;
use crate::results::runs::Person;
use crate::wearer::{Listener, Wearer, ids};
use host::calibration::{Judged, Kept};
use host::clock::{Clock, rfc3339};
use host::failure::Failure;
use host::next::Command;
use host::scanning::{self, BringUp, Settings};

/// The profile of the glove, and what is told of it; `None` with ideal sensors.
///
/// # Errors
/// The session came to nothing; a profile that is not this glove's.
pub(super) fn profile(stage: Stage<'_>, devices: &Virtual) -> Result<Option<(Bound, Person)>> {
    let Stage { options, tell, .. } = stage;
    let seed = options.seed;
    if options.ideal {
        tell.say(format_args!(
            "sensors    ideal: they sit straight and share a heading"
        ));
        return Ok(None);
    }
    if let Some(path) = &options.profile {
        let kept = Kept::read(path)?;
        fits(&kept, seed, &devices.glove)?;
        tell.say(format_args!(
            "person     seed {seed}, by the profile {} of {}, {}",
            path.display(),
            kept.calibrated,
            kept.quality.verdict
        ));
        return Ok(Some((kept.bound, of_file(seed, kept))));
    }
    if options.calibrate {
        return shown(stage, devices).map(Some);
    }
    let done = Wearer::new(seed).calibrated(stage.interrupt)?;
    tell.say(format_args!(
        "person     seed {seed}, calibrated: {}",
        done.line()
    ));
    tell.say(format_args!("           {}", done.fit.line()));
    let person = Person {
        joints_good: Some(good(&done.judged)),
        joints: Some(done.judged.joints().len()),
        repeated: Some(done.repeated),
        session_s: Some(done.lasted_s),
        took_s: Some(done.took_s),
        error: Some(done.fit),
        ..of_file(seed, done.kept.clone())
    };
    Ok(Some((done.kept.bound, person)))
}

fn of_file(seed: u64, kept: Kept) -> Person {
    Person {
        seed,
        calibration: kept.quality,
        joints_good: None,
        joints: None,
        repeated: None,
        session_s: None,
        took_s: None,
        error: None,
    }
}

fn good(judged: &Judged) -> usize {
    let joints = judged.joints();
    joints
        .iter()
        .filter(|joint| joint.verdict == "good")
        .count()
}

fn fits(kept: &Kept, seed: u64, glove: &VirtualGlove) -> Result<()> {
    let Err(misfit) = kept.bound.fits(&ids(glove).map(Some)) else {
        return Ok(());
    };
    let what = format!("the profile is not of the glove of seed {seed}: {misfit}");
    let next = Command::gauntlet("demo")
        .option("--seed", seed.to_string())
        .then(" without --profile calibrates it, or the seed of the simulation that wrote the profile");
    Err(Failure::new(what, next).into())
}

/// The session in real time, drawn where there is a terminal.
fn shown(stage: Stage<'_>, devices: &Virtual) -> Result<(Bound, Person)> {
    let Stage {
        options,
        tell,
        interrupt,
        ..
    } = stage;
    let clock = Clock::start();
    let BringUp { scanning, .. } = scanning::open(
        devices.glove_port.path(),
        Settings {
            reading: options.reading.given(),
            ..Settings::default()
        },
        clock,
        interrupt,
    )?;
    let leading = Leading {
        by_itself: true,
        json: options.json,
        ..Leading::default()
    };
    let person = Listener::Here(devices.glove.clone());
    let source = Source::Port {
        scanning,
        clock,
        feed: None,
    };
    let mut session = Session::new(source, leading, Some(person));
    let led = session.lead(tell, interrupt);
    let done = session.finish();
    let judged = match led? {
        Led::Judged { judged, .. } => judged,
        Led::Stopped => return Err(Failure::interrupted("before the person was calibrated").into()),
        Led::Unfinished(unfinished) => {
            let what = format!("the virtual person's calibration came to nothing: {unfinished}");
            return Err(Failure::new(what, "the same on a machine with less to do").into());
        }
    };
    let kept = judged.kept(ids(&devices.glove), rfc3339(std::time::SystemTime::now()));
    let (good, joints) = (good(&judged), judged.joints().len());
    tell.say(format_args!(
        "person     seed {}, calibrated: {}, {good} of {joints} joints good",
        options.seed, kept.quality.verdict
    ));
    let quality = &kept.quality;
    tell.say(format_args!(
        "           in the last flat pose a segment was tilted by {:.1}°, a heading off by {:.1}°",
        quality.tilt_deg, quality.heading_deg
    ));
    let person = Person {
        joints_good: Some(good),
        joints: Some(joints),
        repeated: Some(done.again.len()),
        session_s: Some(done.took_s),
        took_s: Some(done.took_s),
        ..of_file(options.seed, kept.clone())
    };
    Ok((kept.bound, person))
}
