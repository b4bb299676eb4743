//! The layout for Foxglove in `docs/session-log/` against a log: a path that names nothing draws nothing, and says nothing.

use std::collections::BTreeSet;

use serde_json::Value;

use super::channels::CHANNELS;
use super::drawing::ROOT;
use super::peer_tests::session;
use super::tests::{log, read_back};

const LAYOUT: &str = include_str!("../../../../docs/session-log/foxglove-layout.json");

/// The schema of a topic.
fn schema(topic: &str) -> &'static str {
    let channel = CHANNELS.iter().find(|channel| channel.topic == topic);
    channel
        .unwrap_or_else(|| panic!("no log has {topic}"))
        .schema_name
}

/// The panels in a part of the layout's tree.
fn placed(node: &Value, panels: &mut BTreeSet<String>) {
    match node {
        Value::String(panel) => drop(panels.insert(panel.clone())),
        node => ["first", "second"]
            .iter()
            .for_each(|part| placed(&node[*part], panels)),
    }
}

#[test]
fn what_the_layout_for_foxglove_names_is_in_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (log, feed) = log(&path, []);
    session().into_iter().for_each(|record| feed.hand(record));
    log.finish();
    let found = read_back(&path);
    let layout: Value = serde_json::from_str(LAYOUT).unwrap();
    let panels = layout["configById"].as_object().unwrap();
    let mut plotted = 0;
    for (panel, config) in panels {
        match panel.split('!').next() {
            Some("Plot") => {
                for line in config["paths"].as_array().unwrap() {
                    let path = line["value"].as_str().unwrap();
                    let (topic, fields) = path.split_once('.').unwrap();
                    let pointer = format!("/{}", fields.replace('.', "/"));
                    let messages = found
                        .get(topic)
                        .unwrap_or_else(|| panic!("{topic} of {path}"));
                    let is_number =
                        |message: &Value| message.pointer(&pointer).is_some_and(Value::is_number);
                    assert!(messages.iter().any(is_number), "{path}");
                    plotted += 1;
                }
            }
            Some("RosOut") => {
                let topic = config["topicToRender"].as_str().unwrap();
                assert_eq!(schema(topic), "foxglove.Log");
                assert!(!found[topic].is_empty());
            }
            Some("3D") => {
                assert_eq!(config["followTf"], ROOT);
                for topic in config["topics"].as_object().unwrap().keys() {
                    assert_eq!(schema(topic), "foxglove.SceneUpdate");
                    assert!(!found[topic].is_empty());
                }
            }
            other => panic!("a panel of a kind that is not looked at: {other:?}"),
        }
    }
    assert!(plotted >= 10);
    let mut shown = BTreeSet::new();
    placed(&layout["layout"], &mut shown);
    let configured: BTreeSet<String> = panels.keys().cloned().collect();
    assert_eq!(shown, configured);
}
