//! The profiles of a user's gloves, found by their sensors' ids.

use std::path::{Path, PathBuf};

use glove::calibration::{Misfit, Profile};
use glove::hand::SEGMENT_COUNT;
use glove::imu::UniqueId;

use super::profile_file::{Kept, MadeBy};
use crate::failure::Failure;
use crate::settings::place;
use crate::words;

/// A file among the profiles: what it holds, or why it cannot be used.
pub type Entry = (PathBuf, Result<Kept, Failure>);

/// The profiles of this user's gloves: files in one folder.
#[derive(Debug, Clone)]
pub struct ProfileStore {
    folder: PathBuf,
}

/// A glove's profile among those that are there.
#[derive(Debug, Clone, PartialEq)]
pub enum Found {
    /// This one is of the glove; the newest, where there are several.
    Fits(PathBuf, Box<Kept>),
    /// None is, but this one is of most of its sensors.
    Nearly(PathBuf, Misfit),
    /// The glove's ids tell nothing.
    Untold(Misfit),
    /// None.
    Nothing,
}

/// The profile of the glove with these ids: the named one, else what they find among this user's. Else why there is none. Sensors may
/// still be on their way: who uses it asks [`glove::calibration::Bound::fits`].
///
/// # Errors
/// The named file is none, or this user's cannot be looked at.
pub fn profile_of(
    named: Option<&Path>,
    ids: &[Option<UniqueId>; SEGMENT_COUNT],
) -> Result<Result<(PathBuf, Box<Kept>), String>, Failure> {
    if let Some(path) = named {
        let kept = Kept::read(path)?;
        return Ok(match kept.bound.may_fit(ids) {
            Ok(()) => Ok((path.to_owned(), Box::new(kept))),
            Err(misfit) => Err(format!("{}: {misfit}", path.display())),
        });
    }
    ProfileStore::usual()?.profile_of(ids)
}

/// Whether a glove with these ids may be taken as one whose sensors sit straight and share a heading, though somebody says so (`--ideal`):
/// none that has a profile which says how they sit.
///
/// # Errors
/// Its profile; or this user's cannot be looked at.
pub fn may_be_ideal(place: &Path, ids: &[Option<UniqueId>; SEGMENT_COUNT]) -> Result<(), Failure> {
    ProfileStore::usual()?.may_be_ideal(place, ids)
}

impl ProfileStore {
    fn may_be_ideal(
        &self,
        place: &Path,
        ids: &[Option<UniqueId>; SEGMENT_COUNT],
    ) -> Result<(), Failure> {
        let Found::Fits(path, kept) = self.find(ids)? else {
            return Ok(());
        };
        let profile = &kept.bound.profile;
        if *profile == Profile::straight(profile.side) {
            return Ok(());
        }
        let what = format!(
            "--ideal is not for the glove on {}: by its profile {} its sensors do not sit straight",
            place.display(),
            path.display()
        );
        let next = "the same without --ideal: the profile is found by itself";
        Err(Failure::new(what, next))
    }

    /// Where this user's profiles lie.
    ///
    /// # Errors
    /// The system does not say where a user's settings lie.
    pub fn usual() -> Result<Self, Failure> {
        Ok(Self::at(place::folder()?.join("gloves")))
    }

    /// In another folder; it is made when the first profile is saved.
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
        }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The profile of the glove with these ids, or why there is none to be used.
    fn profile_of(
        &self,
        ids: &[Option<UniqueId>; SEGMENT_COUNT],
    ) -> Result<Result<(PathBuf, Box<Kept>), String>, Failure> {
        Ok(match self.find(ids)? {
            // Whoever kept it wanted it; who wants to drive by it names it.
            Found::Fits(path, kept) if kept.quality.verdict == "bad" => Err(format!(
                "{} came out too bad to be used; --profile takes it all the same",
                path.display()
            )),
            Found::Fits(path, kept) => Ok((path, kept)),
            Found::Nearly(path, misfit) => Err(format!("{}: {misfit}", path.display())),
            Found::Untold(misfit) => Err(misfit.to_string()),
            Found::Nothing => Err(format!(
                "there is no profile of it in {}",
                self.folder.display()
            )),
        })
    }

    /// The file of a glove with these ids.
    pub fn path_of(&self, ids: &[UniqueId; SEGMENT_COUNT]) -> PathBuf {
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(ids.as_flattened());
        self.folder.join(format!("glove-{crc:08x}.toml"))
    }

    /// Keeps a profile in place of the glove's older one, which stays beside it with `.before` behind its name; returns its path.
    ///
    /// # Errors
    /// The folder cannot be made, or a file not be written.
    pub fn save(&self, kept: &Kept) -> Result<PathBuf, Failure> {
        std::fs::create_dir_all(&self.folder).map_err(|error| {
            let what = format!(
                "the folder {} cannot be made: {}",
                self.folder.display(),
                words::disk(&error)
            );
            Failure::new(what, "another place for the profile, with --out FILE")
        })?;
        let path = self.path_of(&kept.bound.ids);
        if let Err(error) = keep_before(&path) {
            let what = format!(
                "the profile before, {}, cannot be kept: {}",
                path.display(),
                words::disk(&error)
            );
            return Err(Failure::new(what, "another place, with --out FILE"));
        }
        kept.write(&path)?;
        Ok(path)
    }

    /// Keeps the profile of a virtual person, where none is there or one that `simulate` made itself; returns its path. One that somebody
    /// else made for this glove stays as it is: that one is returned, too. What cannot be read stays beside it with `.before` behind its name.
    ///
    /// # Errors
    /// As [`ProfileStore::save`], [`ProfileStore::list`].
    pub fn save_simulated(
        &self,
        kept: &Kept,
    ) -> Result<Result<PathBuf, (PathBuf, Box<Kept>)>, Failure> {
        let ids = kept.bound.ids.map(Some);
        if let Some((path, other)) = self.list()?.into_iter().find_map(|(path, other)| {
            let other = other.ok().filter(|other| other.bound.fits(&ids).is_ok())?;
            (other.made_by != MadeBy::Simulate).then_some((path, other))
        }) {
            return Ok(Err((path, Box::new(other))));
        }
        let path = self.path_of(&kept.bound.ids);
        if Kept::read(&path).is_ok() {
            // Its own of before: what stands beside it is somebody's.
            kept.write(&path)?;
            return Ok(Ok(path));
        }
        self.save(kept).map(Ok)
    }

    /// Every profile, by name; what cannot be read with why.
    ///
    /// # Errors
    /// The folder is there and cannot be read.
    pub fn list(&self) -> Result<Vec<Entry>, Failure> {
        let entries = match std::fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => {
                let what = format!("the folder {}: {error}", self.folder.display());
                return Err(Failure::new(what, "a folder that you may read"));
            }
        };
        let mut paths: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
            .collect();
        paths.sort();
        let read = |path: PathBuf| {
            let kept = Kept::read(&path);
            (path, kept)
        };
        Ok(paths.into_iter().map(read).collect())
    }

    /// The profile of the glove with these ids, as far as they were read. Files that cannot be read are passed over.
    ///
    /// # Errors
    /// As [`ProfileStore::list`].
    pub fn find(&self, ids: &[Option<UniqueId>; SEGMENT_COUNT]) -> Result<Found, Failure> {
        let mut best: Option<(PathBuf, Kept)> = None;
        let mut nearest: Option<(PathBuf, Misfit, u32)> = None;
        for (path, kept) in self.list()? {
            let Ok(kept) = kept else { continue };
            match kept.bound.may_fit(ids) {
                Ok(()) => {
                    if best
                        .as_ref()
                        .is_none_or(|(_, old)| old.calibrated < kept.calibrated)
                    {
                        best = Some((path, kept));
                    }
                }
                Err(misfit @ Misfit::Differ(sensors)) => {
                    let differ = sensors.count_ones();
                    // Most of the sensors are those of the profile.
                    let known = ids.iter().flatten().count() as u32;
                    if 2 * differ < known && nearest.as_ref().is_none_or(|(.., n)| differ < *n) {
                        nearest = Some((path, misfit, differ));
                    }
                }
                Err(misfit) => return Ok(Found::Untold(misfit)),
            }
        }
        Ok(match (best, nearest) {
            (Some((path, kept)), _) => Found::Fits(path, Box::new(kept)),
            (None, Some((path, misfit, _))) => Found::Nearly(path, misfit),
            (None, None) => Found::Nothing,
        })
    }
}

/// Keeps what lies at `path` beside it, whole, with `.before` behind its name. A calibration that came out bad does not take the place of
/// the one before it.
fn keep_before(path: &Path) -> std::io::Result<()> {
    let before = path.with_extension("toml.before");
    let is_bad = |kept: Kept| kept.quality.verdict == "bad";
    if before.exists() && Kept::read(path).is_ok_and(is_bad) {
        return Ok(());
    }
    match std::fs::read(path) {
        Ok(bytes) => trainer::whole_file::write(&before, &bytes),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::super::profile_file::tests::kept;
    use super::*;

    #[test]
    fn a_glove_finds_its_own_profile_by_its_ids_and_the_newest_of_several() {
        let folder = tempfile::tempdir().unwrap();
        let store = ProfileStore::at(folder.path().join("not yet/gloves"));
        let (own, other) = (kept(1), kept(2));
        let ids = own.bound.ids.map(Some);
        assert_eq!(store.find(&ids).unwrap(), Found::Nothing);
        let path = store.save(&own).unwrap();
        store.save(&other).unwrap();
        assert_eq!(
            store.find(&ids).unwrap(),
            Found::Fits(path.clone(), Box::new(own.clone()))
        );
        let mut newer = own.clone();
        newer.calibrated = "2027-01-01T00:00:00Z".to_owned();
        let beside = store.folder().join("z.toml");
        newer.write(&beside).unwrap();
        assert_eq!(
            store.find(&ids).unwrap(),
            Found::Fits(beside, Box::new(newer))
        );
        // Saved anew it takes its own file's place.
        assert_eq!(store.save(&own).unwrap(), path);
        assert_eq!(store.list().unwrap().len(), 3);
    }

    #[test]
    fn a_simulated_profile_takes_only_the_place_of_none_and_of_its_own_kind() {
        let folder = tempfile::tempdir().unwrap();
        let store = ProfileStore::at(folder.path());
        let simulated = kept(2);
        assert_eq!(simulated.made_by, MadeBy::Simulate);
        let path = store.save_simulated(&simulated).unwrap().unwrap();
        let mut again = simulated.clone();
        again.calibrated = "2027-01-01T00:00:00Z".to_owned();
        assert_eq!(store.save_simulated(&again).unwrap(), Ok(path.clone()));
        assert_eq!(Kept::read(&path).unwrap(), again);
        let before = path.with_extension("toml.before");
        assert!(!before.exists());
        // Somebody calibrates the same person.
        let measured = Kept {
            made_by: MadeBy::Calibrate,
            ..simulated.clone()
        };
        assert_eq!(store.save(&measured).unwrap(), path);
        let (there, other) = store.save_simulated(&simulated).unwrap().unwrap_err();
        assert_eq!((there, *other), (path.clone(), measured.clone()));
        assert_eq!(Kept::read(&path).unwrap(), measured);
        // What cannot be read is kept beside it.
        std::fs::write(&path, "broken").unwrap();
        assert_eq!(store.save_simulated(&simulated).unwrap(), Ok(path.clone()));
        assert_eq!(Kept::read(&path).unwrap(), simulated);
        assert_eq!(std::fs::read_to_string(before).unwrap(), "broken");
    }

    #[test]
    fn a_profile_that_came_out_bad_is_not_found_and_the_one_before_it_is_still_there() {
        let folder = tempfile::tempdir().unwrap();
        let store = ProfileStore::at(folder.path());
        let good = kept(1);
        let ids = good.bound.ids.map(Some);
        let path = store.save(&good).unwrap();
        assert!(store.profile_of(&ids).unwrap().is_ok());
        let mut bad = good.clone();
        bad.quality.verdict = "bad".to_owned();
        store.save(&bad).unwrap();
        // And another one, no better.
        store.save(&bad).unwrap();
        let why = store.profile_of(&ids).unwrap().unwrap_err();
        assert!(why.contains("too bad to be used"), "{why}");
        let before = path.with_extension("toml.before");
        assert_eq!(Kept::read(&before).unwrap(), good);
        assert_eq!(store.list().unwrap().len(), 1);
    }

    #[test]
    fn a_glove_with_a_profile_is_taken_as_ideal_only_where_that_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let store = ProfileStore::at(folder.path());
        let mut kept = kept(1);
        let ids = kept.bound.ids.map(Some);
        let place = Path::new("/dev/g");
        assert!(store.may_be_ideal(place, &ids).is_ok());
        let path = store.save(&kept).unwrap();
        let refused = store.may_be_ideal(place, &ids).unwrap_err().to_string();
        assert!(refused.contains(&path.display().to_string()), "{refused}");
        assert!(refused.contains("/dev/g"), "{refused}");
        kept.bound.profile = Profile::straight(kept.bound.profile.side);
        store.save(&kept).unwrap();
        assert!(store.may_be_ideal(place, &ids).is_ok());
    }

    #[test]
    fn a_glove_with_an_exchanged_sensor_is_told_which_and_another_glove_finds_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let store = ProfileStore::at(folder.path());
        let path = store.save(&kept(1)).unwrap();
        let mut ids = kept(1).bound.ids.map(Some);
        ids[11] = Some([0xAA; 16]);
        ids[2] = None;
        assert_eq!(
            store.find(&ids).unwrap(),
            Found::Nearly(path, Misfit::Differ(1 << 11))
        );
        assert_eq!(
            store.find(&kept(9).bound.ids.map(Some)).unwrap(),
            Found::Nothing
        );
        let alike = Found::Untold(Misfit::Alike(u16::MAX));
        assert_eq!(store.find(&[Some([1; 16]); 16]).unwrap(), alike);
        assert_eq!(
            store.find(&[None; 16]).unwrap(),
            Found::Untold(Misfit::NoIds)
        );
    }

    #[test]
    fn a_profile_that_cannot_be_read_hides_no_other_and_is_listed_with_why() {
        let folder = tempfile::tempdir().unwrap();
        let store = ProfileStore::at(folder.path());
        std::fs::write(folder.path().join("broken.toml"), "profile = ").unwrap();
        std::fs::write(folder.path().join("note.txt"), "x").unwrap();
        store.save(&kept(1)).unwrap();
        let list = store.list().unwrap();
        assert_eq!(list.len(), 2);
        assert!(
            list[0]
                .1
                .as_ref()
                .unwrap_err()
                .to_string()
                .contains("broken.toml: line 1")
        );
        assert!(matches!(
            store.find(&kept(1).bound.ids.map(Some)).unwrap(),
            Found::Fits(..)
        ));
    }
}
