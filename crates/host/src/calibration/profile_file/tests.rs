use super::*;
use glove::calibration::Invalid;

fn unit(w: f32, x: f32, y: f32, z: f32) -> Quaternion {
    Quaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
}

/// A profile with numbers of every length, and ids that `glove` makes.
pub(crate) fn kept(glove: u8) -> Kept {
    let mut profile = Profile::straight(Side::Left);
    profile.sensors.swap(8, 11);
    for (k, (mounting, axis)) in profile
        .mounting
        .iter_mut()
        .zip(&mut profile.axes)
        .enumerate()
    {
        let t = k as f32 * 0.37 + f32::from(glove) * 0.011;
        *mounting = unit(t.cos(), 1e-6 * t, t.sin() / 3.0, -0.2);
        let length = (1.0 + t * t * 1e-4).sqrt();
        *axis = [1.0 / length, t * 1e-2 / length, 0.0];
    }
    profile.thumb_base = unit(0.7, -0.1, -0.6, 0.2);
    let id = |k: usize| std::array::from_fn(|i| (16 * k + i) as u8 ^ glove);
    Kept {
        bound: Bound {
            profile,
            ids: std::array::from_fn(id),
        },
        calibrated: format!("2026-11-29T11:30:{glove:02}Z"),
        quality: Quality {
            verdict: "doubtful".to_owned(),
            fit_deg: 2.125,
            ratio: 0.57,
            tilt_deg: f64::INFINITY,
            heading_deg: 3.0,
            findings: vec!["a \"finding\" with a \\ and a\nnew line".to_owned()],
        },
        made_by: match glove % 2 {
            0 => MadeBy::Simulate,
            _ => MadeBy::Calibrate,
        },
    }
}

fn read(text: &str) -> Result<Kept, Failure> {
    Kept::from_toml(Path::new("a.toml"), text)
}

#[test]
fn a_profile_reads_back_bit_for_bit_with_what_is_known_of_it() {
    for glove in 0..40 {
        let kept = kept(glove);
        let text = kept.to_toml();
        assert_eq!(read(&text).unwrap(), kept, "{text}");
    }
    let text = kept(1).to_toml();
    assert!(text.contains("hand = \"left\""), "{text}");
    assert!(text.contains("middle_middle = { sensor = 11, mounting = ["));
    assert!(
        text.contains("calibrated = 2026-11-29T11:30:01Z\n"),
        "{text}"
    );
}

#[test]
fn a_file_that_was_edited_or_damaged_is_refused_with_its_line_or_the_name_of_what_is_wrong() {
    let good = kept(3).to_toml();
    let first_number = good.split("thumb_base = [").nth(1).unwrap();
    let digits = first_number.split(',').next().unwrap();
    let changed = digits.replacen('0', "0.0", 1).replacen("..", ".", 1);
    for (from, to, told) in [
        (
            "hand = \"left\"",
            "hand = \"right\"",
            "not as they were measured",
        ),
        (
            "hand = \"left\"",
            "hand = \"both\"",
            "`hand = \"both\"` is neither",
        ),
        ("profile = 1", "profile = 2", "version 1"),
        ("profile = 1", "profile == 1", "line 3: "),
        ("profile = 1", "profil = 1", "unknown field `profil`"),
        ("thumb_base", "thumb_bass", "thumb_bass"),
        (
            "little_distal",
            "little_distall",
            "`little_distall` is no segment",
        ),
        (
            "sensor = 11",
            "sensor = 10",
            "its sensors are not 0 to 15, each once",
        ),
        ("\n    \"0302", "\n    \"03xx", "id 0: `03xx"),
        (
            "ring_distal = {",
            "# ring_distal = {",
            "ring_distal is missing",
        ),
        ("[segments]", "[segments", "line "),
        (digits, "9.5", "the thumb's base is not unit"),
    ] {
        assert!(good.contains(from), "{from}");
        let error = read(&good.replacen(from, to, 1)).unwrap_err();
        let told = told.replace('`', "");
        assert!(
            error.to_string().replace('`', "").contains(&told),
            "{to}: {error}"
        );
        assert!(error.to_string().starts_with("a.toml: "), "{error}");
        assert!(error.next_step().contains("gauntlet help calibrate"));
    }
    assert_ne!(changed, digits);
    let cut = &good[..good.len() / 2];
    assert!(read(cut).is_err());
    assert_eq!(
        Invalid::Sensors.to_string(),
        "its sensors are not 0 to 15, each once"
    );
}

#[test]
fn no_digit_of_a_number_can_be_changed_unseen() {
    let good = kept(5).to_toml();
    let from = good.find("[segments]").unwrap();
    let mut tried = 0;
    for (at, _) in good
        .char_indices()
        .filter(|(at, c)| *at > from && c.is_ascii_digit())
    {
        let mut edited = good.clone().into_bytes();
        edited[at] = if edited[at] == b'9' {
            b'8'
        } else {
            edited[at] + 1
        };
        let edited = String::from_utf8(edited).unwrap();
        // A last digit beyond a number's precision may stand for the same number.
        if let Ok(read) = read(&edited) {
            assert_eq!(read.bound, kept(5).bound);
        } else {
            tried += 1;
        }
    }
    assert!(tried > 500, "{tried}");
}

#[test]
fn a_file_that_is_not_there_is_no_text_or_endless_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let error = Kept::read(&path).unwrap_err();
    assert!(error.to_string().contains("there is no such file"));
    assert!(error.next_step().contains("gauntlet calibrate --list"));
    std::fs::write(&path, b"profile = 1\n\xff").unwrap();
    assert!(
        Kept::read(&path)
            .unwrap_err()
            .to_string()
            .contains("line 2 is not UTF-8")
    );
    let error = Kept::read(Path::new("/dev/zero")).unwrap_err();
    assert!(error.to_string().contains("longer than 64 kB"), "{error}");
}

#[test]
fn a_profile_that_is_none_is_never_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let mut bad = kept(1);
    bad.bound.profile.axes[4] = [f32::NAN; 3];
    assert!(bad.write(&path).is_err());
    assert!(!path.exists());
    let nowhere = folder.path().join("no/a.toml");
    assert!(
        kept(1)
            .write(&nowhere)
            .unwrap_err()
            .to_string()
            .contains("is not written")
    );
}
