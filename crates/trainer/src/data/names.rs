//! The names of columns as people write them: `index_mcp_flex`, `Index MCP flex [deg]`, `# time (ms)`.

/// A unit that a header names.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Unit {
    /// Radians.
    Radians,
    /// Degrees.
    Degrees,
    /// Seconds, and how many of them one is.
    Time(f64),
    /// Any other, as written.
    Other(String),
}

impl Unit {
    /// Of a word, in brackets or not; `None` where nothing is written.
    pub fn of(word: &str) -> Option<Self> {
        let word = word.trim_matches(|c: char| c.is_whitespace() || "[](){}".contains(c));
        let lower = word.to_lowercase();
        Some(match lower.as_str() {
            "" => return None,
            "rad" | "rads" | "radian" | "radians" => Self::Radians,
            "deg" | "degs" | "degree" | "degrees" | "°" | "º" => Self::Degrees,
            "s" | "sec" | "secs" | "second" | "seconds" => Self::Time(1.0),
            "ms" | "msec" | "msecs" | "millisecond" | "milliseconds" => Self::Time(1e-3),
            "us" | "µs" | "μs" | "usec" | "microsecond" | "microseconds" => Self::Time(1e-6),
            "ns" | "nsec" | "nanosecond" | "nanoseconds" => Self::Time(1e-9),
            _ => Self::Other(word.to_owned()),
        })
    }
}

/// A field of the header.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    /// As written, trimmed.
    pub written: String,
    /// In lower case, with `_` between words, without a unit.
    pub plain: String,
    pub unit: Option<Unit>,
}

impl Name {
    pub fn of(field: &str) -> Self {
        let written = field
            .trim_start_matches(['\u{feff}', '#', '%'])
            .trim_matches(|c: char| c.is_whitespace() || c == '"' || c == '\'')
            .to_owned();
        let (base, mut unit) = match written.find(['[', '(']) {
            Some(place) if place > 0 => (&written[..place], Unit::of(&written[place..])),
            _ => (written.as_str(), None),
        };
        let lower = base.trim().to_lowercase();
        let words = lower.split(|c: char| c.is_whitespace() || "-._:/".contains(c));
        let mut words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
        // A unit as the last word: `index_mcp_flex_deg`.
        if unit.is_none() && words.len() > 1 {
            let last = words.last().and_then(|word| Unit::of(word));
            if let Some(found @ (Unit::Radians | Unit::Degrees | Unit::Time(_))) = last {
                words.pop();
                unit = Some(found);
            }
        }
        Self {
            plain: words.join("_"),
            written,
            unit,
        }
    }

    /// Whether it is meant by `column`, to the letter or otherwise spelled.
    pub fn is(&self, column: &str) -> bool {
        self.written == column || self.plain == column
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_understood_as_people_write_them() {
        for (field, plain, unit) in [
            ("index_mcp_flex", "index_mcp_flex", None),
            (
                "\u{feff}Index MCP flex [deg]",
                "index_mcp_flex",
                Some(Unit::Degrees),
            ),
            ("# time (ms)", "time", Some(Unit::Time(1e-3))),
            ("time_s", "time", Some(Unit::Time(1.0))),
            (
                "\"index-mcp-flex_rad\"",
                "index_mcp_flex",
                Some(Unit::Radians),
            ),
            (
                "index_mcp_flex (%)",
                "index_mcp_flex",
                Some(Unit::Other("%".to_owned())),
            ),
            ("q0", "q0", None),
        ] {
            let name = Name::of(field);
            assert_eq!((name.plain.as_str(), &name.unit), (plain, &unit), "{field}");
        }
        assert!(Name::of("time_s").is("time_s") && !Name::of("time_ms").is("time_s"));
    }
}
