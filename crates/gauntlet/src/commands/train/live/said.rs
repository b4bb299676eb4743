//! What is said of a taught map.

use host::training::judgement::Judgement;

/// The verdict, which finger moves what, and how far the map is off the pairs: lines, each with its name or under the one before.
pub(super) fn lines(judgement: &Judgement) -> Vec<(&'static str, String)> {
    let mut lines = vec![("verdict", judgement.to_string())];
    lines.extend(
        judgement
            .advice()
            .map(|advice| ("", format!("try: {advice}"))),
    );
    lines.extend(
        judgement
            .influence
            .words()
            .into_iter()
            .map(|text| ("", text)),
    );
    if let Some(pairs) = &judgement.pairs {
        let (most, middle) = pairs.off();
        lines.push((
            "pairs",
            format!(
                "the map is off them by {most:.0} counts at most, by {middle:.0} in the middle"
            ),
        ));
    }
    lines
}
