//! Which reference pairs a person asks for.

/// Where reference pairs come from, and how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PairChoice {
    /// Where from.
    pub kind: PairKind,
    /// L; none said: as many as usual.
    pub count: Option<usize>,
}

/// Where reference pairs come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PairKind {
    /// Chosen one after another, at the target that is farthest from what is reached.
    Adaptive,
    /// Those of a file.
    Fixed,
    /// Of the true pairs.
    Random,
    /// The paper's gripper poses.
    Table3,
    /// Of a ring of matched points, at equal distances.
    Boundary,
}

impl PairChoice {
    /// Most pairs that can be asked for.
    const MOST: usize = 100;

    /// From what a person typed: `8`, `random:5`, `table3`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (word, number) = match text.split_once(':') {
            Some((word, number)) => (word, Some(number)),
            None if text.starts_with(|c: char| c.is_ascii_digit()) => ("adaptive", Some(text)),
            None => (text, None),
        };
        let kind = match word {
            "adaptive" => PairKind::Adaptive,
            "random" => PairKind::Random,
            "fixed" => PairKind::Fixed,
            "table3" | "heuristic" => PairKind::Table3,
            "boundary" => PairKind::Boundary,
            _ => {
                return Err(format!(
                    "{word} is no kind of pairs: adaptive, random, fixed, table3 (or heuristic) or boundary"
                ));
            }
        };
        let count = number.map(|number| match number.parse::<usize>() {
            Ok(count) if (1..=Self::MOST).contains(&count) => Ok(count),
            _ => Err(format!("{number} is not between 1 and {}", Self::MOST)),
        });
        let count = count.transpose()?;
        if kind == PairKind::Table3 && count.is_some_and(|count| count > 10) {
            return Err("Table 3 has 10 poses".to_owned());
        }
        Ok(Self { kind, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_a_number_or_a_kind_with_a_number() {
        let choice = |kind, count| Ok(PairChoice { kind, count });
        assert_eq!(PairChoice::parse("8"), choice(PairKind::Adaptive, Some(8)));
        assert_eq!(
            PairChoice::parse("random:5"),
            choice(PairKind::Random, Some(5))
        );
        assert_eq!(PairChoice::parse("table3"), choice(PairKind::Table3, None));
        assert_eq!(
            PairChoice::parse("heuristic:8"),
            choice(PairKind::Table3, Some(8))
        );
        assert_eq!(PairChoice::parse("fixed"), choice(PairKind::Fixed, None));
        for wrong in [
            "0",
            "101",
            "table3:11",
            "heuristic:11",
            "some",
            "random:",
            "-1",
            "8:8",
        ] {
            assert!(PairChoice::parse(wrong).is_err(), "{wrong}");
        }
    }
}
