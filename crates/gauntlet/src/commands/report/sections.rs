//! The page's tables and sentences.

use std::fmt::Write;

use super::shown::Shown;
use host::glove::hand::JOINT_NAMES;
use host::training::judgement::Judgement;
use host::training::judgement::influence::CAUSES;
use host::words::{axis_words, gripper_words};

/// An influence of so many counts has the full colour.
const FULL: f32 = 200.0;

/// Text in HTML.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// The verdict, and each fault with what helps.
pub(super) fn verdict(judgement: &Judgement) -> String {
    let class = match (judgement.good(), judgement.faults.is_empty()) {
        (true, true) => "good",
        (true, false) => "doubt",
        (false, _) => "bad",
    };
    let mut text = format!(
        "<p class=\"verdict {class}\">{}</p>",
        escaped(&judgement.to_string())
    );
    if !judgement.faults.is_empty() {
        text.push_str("<ul>");
        for fault in judgement.named() {
            // Writing to a string never fails, here and below.
            let _ = write!(
                text,
                "<li><b>{}</b><br><span class=\"try\">{}</span></li>",
                escaped(&fault.what),
                escaped(fault.advice)
            );
        }
        text.push_str("</ul>");
    }
    text
}

/// The measures with their bars.
pub(super) fn measures(shown: &Shown<'_>) -> String {
    let quality = &shown.judgement.quality;
    let row = |name: &str, value: String, bar: String, means: &str| {
        format!(
            "<tr><th>{name}</th><td>{value}</td><td>{bar}</td><td class=\"means\">{means}</td></tr>"
        )
    };
    let most = quality
        .bar
        .d_knn
        .map_or_else(|| "–".to_owned(), |most| format!("at most {most}"));
    let rows = [
        row(
            "volume occupancy",
            format!("{:.3}", quality.volume_occupancy),
            format!("at least {}", quality.bar.volume_occupancy),
            "the share of the gripper's poses that your hand reaches",
        ),
        row(
            "d-Knn",
            format!("{:.1}", quality.d_knn),
            most,
            "how far apart hands are that the map brings together: high where it folds or twists",
        ),
        row(
            "mean distortion",
            format!("{:.2}", quality.mean_distortion),
            "–".to_owned(),
            "how much small motions are stretched: low is calm",
        ),
    ];
    let held_out = match shown.held_out {
        Some(true) => " These poses did not train the map.",
        Some(false) => " These poses trained the map: on others it may be a little worse.",
        None => "",
    };
    format!(
        "<table><tr><th></th><th>this map</th><th>bar</th><th></th></tr>{}</table><p>Measured on {} {}.{held_out}</p>",
        rows.concat(),
        quality.frames,
        escaped(&quality.measured_on)
    )
}

/// Which finger moves what, as a matrix and in words, and which joint.
pub(super) fn influence(shown: &Shown<'_>) -> String {
    let axes = axis_words(shown.space.axes());
    let influence = &shown.judgement.influence;
    let heads = |names: &[&str]| -> String {
        names
            .iter()
            .map(|name| format!("<th>{name}</th>"))
            .collect()
    };
    let mut text = format!(
        "<table class=\"matrix\"><tr><th></th>{}</tr>",
        heads(&CAUSES)
    );
    for (axis, row) in axes.iter().zip(&influence.mean) {
        let _ = write!(text, "<tr><th>{axis}</th>");
        row.iter().for_each(|change| text.push_str(&cell(*change)));
        text.push_str("</tr>");
    }
    text.push_str("</table><ul>");
    for sentence in influence.words() {
        let _ = write!(text, "<li>{}</li>", escaped(&sentence));
    }
    let _ = write!(
        text,
        "</ul><details><summary>each joint alone</summary><table class=\"matrix\"><tr><th></th>{}</tr>",
        heads(axes)
    );
    for (joint, name) in JOINT_NAMES.iter().enumerate() {
        let _ = write!(text, "<tr><th>{name}</th>");
        for row in &influence.joints {
            text.push_str(&cell(row[joint]));
        }
        text.push_str("</tr>");
    }
    text.push_str("</table></details>");
    text
}

/// A change, counts, on a ground of its own.
fn cell(change: f32) -> String {
    let depth = (change.abs() / FULL).min(1.0);
    // Blue closes, orange opens: told apart by the colour-blind, too.
    let hue = if change > 0.0 {
        "0,114,178"
    } else {
        "213,94,0"
    };
    let ink = if depth > 0.6 { "#fff" } else { "#111" };
    format!("<td style=\"background:rgba({hue},{depth:.2});color:{ink}\">{change:+.0}</td>")
}

/// How far the gripper is reached.
pub(super) fn reach(shown: &Shown<'_>) -> String {
    let reach = &shown.judgement.reach;
    let axes = axis_words(shown.space.axes());
    let mut text = format!(
        "<p><b>{}</b>.</p><table><tr><th>axis</th><th>from</th><th>to</th></tr>",
        escaped(&reach.words())
    );
    for (name, (low, high)) in axes.iter().zip(&reach.ranges) {
        let (low, high) = (low.clamp(0.0, 255.0), high.clamp(0.0, 255.0));
        let _ = write!(
            text,
            "<tr><th>{name}</th><td>{low:.0}</td><td>{high:.0}</td></tr>"
        );
    }
    text.push_str(
        "</table><table><tr><th>corner of the gripper's space</th><th>nearest, counts</th></tr>",
    );
    for corner in reach.corners.iter().take(6) {
        let _ = write!(
            text,
            "<tr><td>{}</td><td>{:.0}</td></tr>",
            escaped(&gripper_words(&corner.counts)),
            corner.nearest
        );
    }
    text.push_str("</table>");
    text
}

/// The pairs one by one, the worst first.
pub(super) fn pairs(shown: &Shown<'_>) -> String {
    let Some(pairs) = &shown.judgement.pairs else {
        return "<p>The model carries no reference pairs (it is of an earlier version): --pairs-file names them.</p>".to_owned();
    };
    let (most, middle) = pairs.off();
    let mut order: Vec<usize> = (0..pairs.each.len()).collect();
    let key = |k: &usize| f64::from(pairs.each[*k].left_out);
    order.sort_by(|a, b| key(b).total_cmp(&key(a)));
    let mut text = format!(
        "<p>The map is off its pairs by {most:.0} counts at most, by {middle:.0} in the middle. <b>Left out</b> says how far a target is \
         from what the other pairs say of its hand pose: much more than the others' is a pair that was shown wrongly.</p>\
         <table><tr><th>pair</th><th>asked</th><th>the map</th><th>off by</th><th>left out</th></tr>"
    );
    let counts = |row: &[f32]| {
        let whole: Vec<String> = row.iter().map(|count| format!("{count:.0}")).collect();
        whole.join(" ")
    };
    for k in order {
        let pair = &pairs.each[k];
        let class = if pair.left_out > 120.0 && pairs.each.len() > 5 {
            " class=\"odd\""
        } else {
            ""
        };
        let _ = write!(
            text,
            "<tr{class}><th>{}</th><td>{}<br><span class=\"means\">{}</span></td><td>{}</td><td>{:.0}</td><td>{:.0}</td></tr>",
            k + 1,
            counts(&pair.target),
            escaped(&gripper_words(&pair.target)),
            counts(&pair.mapped),
            pair.off,
            pair.left_out
        );
    }
    text.push_str("</table>");
    text
}
