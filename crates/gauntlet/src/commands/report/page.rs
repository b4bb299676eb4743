//! The page: one file, nothing fetched, no script.

use std::fmt::Write;

use super::pictures;
use super::sections::{escaped, influence, measures, pairs, reach, verdict};
use super::shown::Shown;
use host::trainer::hand::Space;

/// What a browser may fetch: nothing.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";

const STYLE: &str = "\
:root{color-scheme:light}\
body{font:16px/1.5 system-ui,sans-serif;color:#111;background:#fff;margin:0 auto;padding:24px 20px 64px;max-width:1080px}\
h1{font-size:26px;margin:0 0 4px}h2{font-size:20px;margin:40px 0 8px;border-top:1px solid #ddd;padding-top:24px}\
.file{color:#555;margin:0 0 16px;overflow-wrap:anywhere}\
.verdict{font-size:19px;font-weight:600;padding:14px 18px;border-radius:8px;border-left:8px solid}\
.good{background:#e3f3ec;border-color:#009e73}.doubt{background:#fdf3d8;border-color:#e69f00}.bad{background:#fbe5da;border-color:#d55e00}\
table{border-collapse:collapse;margin:12px 0}th,td{text-align:left;padding:6px 12px;border-bottom:1px solid #e4e4e4;vertical-align:top}\
th{font-weight:600}.matrix td{text-align:right;min-width:56px;font-variant-numeric:tabular-nums}\
.means,.try{color:#555;font-size:14px}.odd td,.odd th{background:#fbe5da}\
figure{margin:12px 0;overflow-x:auto}figure svg{max-width:100%;height:auto}figcaption{color:#555;font-size:14px}\
ul{padding-left:22px}li{margin:4px 0}";

/// Draws it.
///
/// # Errors
/// The drawing library's.
pub(super) fn page(shown: &Shown<'_>) -> Result<String, charts::Error> {
    let title = format!("Map of {}", shown.file.display());
    let mut body = String::new();
    // Writing to a string never fails, here and below.
    let _ = write!(
        body,
        "<h1>{}</h1><p class=\"file\">judged on {}</p>{}",
        escaped(&title),
        escaped(&shown.poses.display().to_string()),
        verdict(shown.judgement)
    );
    section(&mut body, "Which finger moves what", &influence(shown));
    note(
        &mut body,
        "Counts that an axis changes by when a finger goes from straight to bent and everything else stays, in the mean over your poses: + closes, − opens.",
    );
    section(&mut body, "Hand and gripper over six seconds", "");
    figure(
        &mut body,
        pictures::strip(shown)?,
        "The six seconds in which most happens, a pose every half second, with the gripper's counts.",
    );
    section(&mut body, "Measures", &measures(shown));
    section(&mut body, "How far the gripper is reached", &reach(shown));
    figure(
        &mut body,
        pictures::histograms(shown)?,
        "Where each axis is, over all your poses, and over everything the gripper can do.",
    );
    section(
        &mut body,
        "The reference pairs, the worst first",
        &pairs(shown),
    );
    if let Some(svg) = pictures::pairs(shown)? {
        figure(
            &mut body,
            svg,
            "Each pair as it was shown: the hand above, the gripper below.",
        );
    }
    section(&mut body, "Folds and twists", "");
    match shown.space {
        Space::ThreeFinger => figure(
            &mut body,
            pictures::dissimilar(shown)?,
            "What your poses become, coloured by d-Knn: red where the map brings hands together that are far apart.",
        ),
        Space::OneAxis => figure(
            &mut body,
            pictures::closing(shown)?,
            "Where the gripper's fingers are as yours bend. A map that folds comes back on itself; one finger alone moves it in part, hence the width.",
        ),
    }
    section(&mut body, "Both domains in their principal axes", "");
    figure(
        &mut body,
        pictures::domains(shown)?,
        "The poses of hand and gripper along the axes in which they vary most, with the pairs and the six seconds from above.",
    );
    section(&mut body, "How it was trained", &metadata(shown));
    match pictures::learning(shown)? {
        Some(svg) => figure(
            &mut body,
            svg,
            "How the cost fell. It jumps where a pair is added, where the map begins to be spread over the gripper's space, and where another start takes the lead.",
        ),
        None => note(
            &mut body,
            "No learning curve: the training left none beside the model.",
        ),
    }
    Ok(format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\
         <title>{}</title><style>{STYLE}</style></head><body>{body}</body></html>\n",
        escaped(&title)
    ))
}

fn section(body: &mut String, title: &str, inside: &str) {
    let _ = write!(body, "<h2>{title}</h2>{inside}");
}

fn note(body: &mut String, text: &str) {
    let _ = write!(body, "<p class=\"means\">{text}</p>");
}

fn figure(body: &mut String, svg: String, caption: &str) {
    let _ = write!(
        body,
        "<figure>{svg}<figcaption>{caption}</figcaption></figure>"
    );
}

fn metadata(shown: &Shown<'_>) -> String {
    let mut text = String::from("<table>");
    for key in [
        "cost",
        "lambda",
        "alpha",
        "pairs",
        "seed",
        "epochs",
        "data_sha256",
    ] {
        if let Some(value) = shown.model.metadata.get(key) {
            let _ = write!(text, "<tr><th>{key}</th><td>{}</td></tr>", escaped(value));
        }
    }
    text.push_str("</table>");
    text
}
