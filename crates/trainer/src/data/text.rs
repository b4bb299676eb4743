//! From the bytes of a file to the fields of its rows: the encoding, the line of the header, what stands between the fields.

use super::error::Error;
use super::names::Name;
use std::path::Path;

/// The longest file of samples: some million rows.
pub(super) const LONGEST: u64 = 256 << 20;
/// Most fields of a header: as many inputs and outputs as a map can have, and as much again. More is no table of samples, and
/// would take its time by the square.
const FIELDS: usize = 16_384;
/// Longest line: so many fields of 64 bytes.
const LONGEST_LINE: usize = FIELDS * 64;
/// Lines in which the header is looked for.
const HEADER_WITHIN: usize = 500;

/// What stands between two fields. Of equally good ones the first is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    Byte(u8),
    /// One space or more.
    Spaces,
}

impl Separator {
    const ALL: [Self; 5] = [
        Self::Byte(b','),
        Self::Byte(b';'),
        Self::Byte(b'\t'),
        Self::Byte(b'|'),
        Self::Spaces,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Byte(b';') => "semicolons",
            Self::Byte(b'\t') => "tabs",
            Self::Byte(b'|') => "upright strokes",
            Self::Byte(_) => "commas",
            Self::Spaces => "spaces",
        }
    }

    fn fields(self, line: &str) -> Vec<String> {
        let Self::Byte(byte) = self else {
            return line.split_whitespace().map(str::to_owned).collect();
        };
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(byte)
            .trim(csv::Trim::All)
            .from_reader(line.as_bytes());
        let record = reader.records().next().and_then(Result::ok);
        record.map_or_else(Vec::new, |r| r.iter().map(str::to_owned).collect())
    }
}

/// A file taken apart.
pub(super) struct Sheet {
    pub header: Vec<String>,
    pub separator: Separator,
    /// With the line on which each starts, from 1.
    pub rows: Vec<(u64, csv::StringRecord)>,
    /// What was taken otherwise than it stands.
    pub notes: Vec<String>,
}

impl Sheet {
    /// Takes a file's bytes apart; `wanted` says whether a field names a column that is looked for.
    pub fn read(bytes: &[u8], file: &Path, wanted: &dyn Fn(&Name) -> bool) -> Result<Self, Error> {
        let text = decode(bytes, file)?;
        let lines: Vec<&str> = text.lines().collect();
        let not_csv = |place: usize, what: String| Error::NotCsv {
            file: file.to_owned(),
            line: place as u64 + 1,
            what,
        };
        if let Some(place) = lines.iter().position(|line| line.len() > LONGEST_LINE) {
            let bytes = lines[place].len();
            return Err(not_csv(place, format!("a line of {bytes} bytes")));
        }
        let Some((place, separator)) = find_header(&lines, wanted) else {
            return Err(Error::Empty {
                file: file.to_owned(),
            });
        };
        let mut notes = Vec::new();
        let above = lines[..place].iter().filter(|l| !l.trim().is_empty());
        match above.count() {
            0 => {}
            1 => notes.push("one line above the header is passed over".to_owned()),
            count => notes.push(format!("{count} lines above the header are passed over")),
        }
        if separator != Separator::Byte(b',') {
            notes.push(format!("{} stand between the fields", separator.name()));
        }
        let header = separator.fields(lines[place]);
        if header.len() > FIELDS {
            let what = format!("a header of {} fields, more than {FIELDS}", header.len());
            return Err(not_csv(place, what));
        }
        if is_data(&header) {
            return Err(Error::NoHeader {
                file: file.to_owned(),
                line: place as u64 + 1,
                fields: header.len(),
            });
        }
        let body = &lines[place + 1..];
        let comments = body.iter().filter(|l| l.starts_with('#')).count();
        if comments > 0 {
            notes.push(format!(
                "lines that begin with # are passed over: {comments}"
            ));
        }
        Ok(Self {
            rows: records(body, place as u64 + 1, separator, file)?,
            header,
            separator,
            notes,
        })
    }
}

/// The rows below the header, which stands on line `header`.
fn records(
    body: &[&str],
    header: u64,
    separator: Separator,
    file: &Path,
) -> Result<Vec<(u64, csv::StringRecord)>, Error> {
    // Runs of spaces are one separator each.
    let (text, delimiter) = match separator {
        Separator::Byte(byte) => (body.join("\n"), byte),
        Separator::Spaces => {
            let line = |l: &&str| l.split_whitespace().collect::<Vec<_>>().join("\t");
            (body.iter().map(line).collect::<Vec<_>>().join("\n"), b'\t')
        }
    };
    let reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = Vec::new();
    for record in reader.into_records() {
        let record = record.map_err(|error| Error::NotCsv {
            file: file.to_owned(),
            line: header + error.position().map_or(1, csv::Position::line),
            what: error.to_string(),
        })?;
        let place = record.position();
        let line = place.map_or(0, |place| header + line_of(place, text.as_bytes()));
        rows.push((line, record));
    }
    Ok(rows)
}

/// The line on which a record starts: its position is before the empty lines and the comments that were passed over.
fn line_of(place: &csv::Position, bytes: &[u8]) -> u64 {
    let start = usize::try_from(place.byte()).unwrap_or(usize::MAX);
    let mut rest = bytes.get(start..).unwrap_or_default();
    let mut passed = 0;
    while let Some(first @ (b'\n' | b'#')) = rest.first() {
        let end = match first {
            b'\n' => Some(0),
            _ => rest.iter().position(|byte| *byte == b'\n'),
        };
        let Some(end) = end else { break };
        rest = rest.get(end + 1..).unwrap_or_default();
        passed += 1;
    }
    place.line() + passed
}

/// Where the header is: the line with the most of the columns that are wanted; without any, the first line that is not empty.
fn find_header(lines: &[&str], wanted: &dyn Fn(&Name) -> bool) -> Option<(usize, Separator)> {
    let mut best = None;
    let mut most = 0;
    for (place, line) in lines.iter().enumerate().take(HEADER_WITHIN) {
        for separator in Separator::ALL {
            let fields = separator.fields(line);
            let found = fields.iter().filter(|f| wanted(&Name::of(f))).count();
            if found > most {
                (best, most) = (Some((place, separator)), found);
            }
            if found > 1 && found * 2 > fields.len() {
                return best;
            }
        }
    }
    best.or_else(|| {
        let place = lines.iter().position(|line| !line.trim().is_empty())?;
        let count = |s: &Separator| s.fields(lines[place]).len();
        // The last of equal ones is taken by `max_by_key`: begin with the least likely.
        let all = Separator::ALL.into_iter().rev();
        Some((place, all.max_by_key(count)?))
    })
}

/// Whether a line in the header's place holds numbers.
fn is_data(fields: &[String]) -> bool {
    let number = |field: &String| field.replace(',', ".").parse::<f64>().is_ok();
    fields.iter().filter(|f| number(f)).count() * 2 > fields.len()
}

/// The text of a file with one kind of line end, without a byte order mark.
fn decode(bytes: &[u8], file: &Path) -> Result<String, Error> {
    let refuse = |what: &str, next: String| {
        Err(Error::Encoding {
            file: file.to_owned(),
            what: what.to_owned(),
            next,
        })
    };
    let iconv = |from: &str| {
        let name = file.display();
        format!("iconv -f {from} -t UTF-8 '{name}' > utf8.csv")
    };
    let table = || "its table saved as comma-separated UTF-8 text".to_owned();
    match bytes {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => {
            return refuse("UTF-32 text", iconv("UTF-32"));
        }
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => return refuse("UTF-16 text", iconv("UTF-16")),
        [b'P', b'K', 3, 4, ..] => return refuse("a spreadsheet or archive (zip)", table()),
        [0xd0, 0xcf, 0x11, 0xe0, ..] => return refuse("an old spreadsheet (xls)", table()),
        [0x1f, 0x8b, ..] => {
            return refuse("compressed (gzip)", format!("gunzip '{}'", file.display()));
        }
        _ => {}
    }
    // Without a mark: every other byte of UTF-16 is nothing.
    let start = &bytes[..bytes.len().min(4096)];
    let nothing = |odd: usize| {
        start
            .iter()
            .skip(odd)
            .step_by(2)
            .filter(|b| **b == 0)
            .count()
    };
    for (odd, name) in [(1, "UTF-16LE"), (0, "UTF-16BE")] {
        if nothing(odd) * 4 > start.len() {
            return refuse("UTF-16 text", iconv(name));
        }
    }
    let text = core::str::from_utf8(bytes).map_err(|error| {
        let good = &bytes[..error.valid_up_to()];
        let ends = |window: &[u8]| window.iter().filter(|byte| **byte == b'\n').count();
        // Old line ends alone count, too.
        let returns = good.iter().filter(|byte| **byte == b'\r').count();
        Error::NotCsv {
            file: file.to_owned(),
            line: ends(good).max(returns) as u64 + 1,
            what: format!("byte {:#04x} is not UTF-8", bytes[good.len()]),
        }
    })?;
    let text = text.trim_start_matches('\u{feff}');
    Ok(text.replace("\r\n", "\n").replace('\r', "\n"))
}
