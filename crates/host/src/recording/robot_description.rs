//! The robot description of a log: hand and gripper as URDF (wiki.ros.org/urdf/XML) of simple shapes.
//!
//! Its links carry the names of the transforms' frames, so that a viewer moves them by those. Joints have the origin of a flat
//! hand and an open gripper.

use core::fmt::Write as _;

use nalgebra::{Quaternion, UnitQuaternion};

use super::drawing::{Drawn, Part, ROOT};
use super::foxglove::{Pose, Primitive};

/// The description, XML.
pub(super) fn urdf(drawn: Drawn) -> String {
    let mut text = String::from("<?xml version=\"1.0\"?>\n<robot name=\"gauntlet\">\n");
    let _ = writeln!(text, "  <link name=\"{ROOT}\"/>");
    for part in drawn.parts() {
        link(&mut text, &part);
        joint(&mut text, &part);
    }
    text.push_str("</robot>\n");
    text
}

fn link(text: &mut String, part: &Part) {
    let _ = writeln!(text, "  <link name=\"{}\">", part.name);
    let [r, g, b] = part.colour;
    for shape in &part.shapes {
        let (pose, geometry) = match shape {
            Primitive::Box { pose, size } => {
                let [x, y, z] = size;
                (*pose, format!("<box size=\"{x} {y} {z}\"/>"))
            }
            Primitive::Cylinder {
                pose,
                thickness,
                length,
            } => {
                let radius = 0.5 * thickness;
                (
                    *pose,
                    format!("<cylinder radius=\"{radius:.5}\" length=\"{length:.5}\"/>"),
                )
            }
            Primitive::Sphere { centre, thickness } => {
                let radius = 0.5 * thickness;
                (
                    Pose::at(*centre),
                    format!("<sphere radius=\"{radius:.5}\"/>"),
                )
            }
        };
        let _ = writeln!(
            text,
            "    <visual>{}<geometry>{geometry}</geometry><material name=\"{}\"><color rgba=\"{r} {g} {b} 1\"/></material></visual>",
            origin(&pose),
            part.name,
        );
    }
    text.push_str("  </link>\n");
}

fn joint(text: &mut String, part: &Part) {
    let (name, parent) = (part.name, part.parent);
    let kind = if part.fixed { "fixed" } else { "floating" };
    let _ = writeln!(
        text,
        "  <joint name=\"{name}_joint\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{name}\"/>{}</joint>",
        origin(&part.rest),
    );
}

fn origin(pose: &Pose) -> String {
    let [x, y, z] = pose.position;
    let [i, j, k, w] = pose.rotation;
    let turn = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k));
    let (roll, pitch, yaw) = turn.euler_angles();
    format!("<origin xyz=\"{x:.5} {y:.5} {z:.5}\" rpy=\"{roll:.5} {pitch:.5} {yaw:.5}\"/>")
}

#[cfg(test)]
mod tests {
    use super::super::drawing::tests::DRAWN;

    #[test]
    fn every_frame_of_the_transforms_is_a_link_with_one_joint_to_its_parent() {
        let text = super::urdf(DRAWN);
        for part in DRAWN.parts() {
            let link = format!("<link name=\"{}\">", part.name);
            assert_eq!(text.matches(&link).count(), 1, "{link}");
            let joint = format!(
                "<parent link=\"{}\"/><child link=\"{}\"/>",
                part.parent, part.name
            );
            assert_eq!(text.matches(&joint).count(), 1, "{joint}");
        }
        assert_eq!(text.matches("<link ").count(), DRAWN.parts().len() + 1);
        assert!(!text.contains("NaN"));
    }
}
