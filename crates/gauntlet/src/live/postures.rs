//! The postures of the guided calibration, drawn with characters. docs/calibrate.md shows the same.

use host::glove::calibration::Step;

/// Lines of a drawing, at most.
pub const ROWS: u16 = 7;
/// Its columns, at most.
pub const COLUMNS: u16 = 34;

const FLAT: &str = "\
 from the side

   arm      hand       fingers
 ▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▖
              ▀▀▀▀▘ thumb
 ══════════════════════════════
             table";

const THUMB_UP: &str = "\
 from the fingertips (right hand)

          ║  thumb
         ┌╨┐
    back │ │ palm
         │ │
         └─┘";

const PALM_UP: &str = "\
 from the side

              palm
 ▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▖
   arm        back     fingers";

const PALM_DOWN: &str = "\
 from the side

              back
 ▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▖
   arm        palm     fingers";

const FINGERS_UP: &str = "\
 from the side
            █
            █ fingers
            █
            █ hand
            █
   ▄▄▄▄▄▄▄▄▄█ arm";

const FINGERS_DOWN: &str = "\
 from the side
   ▄▄▄▄▄▄▄▄▄▄ arm
            █
            █ hand
            █
            █ fingers
            █";

const BEND: &str = "\
 one finger, the others still

 ▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▖  straight
 hand       ╲
             ╲▁▁       and bent,
            ▁▁╱        twice";

const THUMB: &str = "\
 into the palm

  █ █ █ █             █ █ █ █
 ▐█▄█▄█▄█▌           ▐█▄█▄█▄█▌
▚▐███████▌   ⇄       ▐▚▚▚████▌
 ▀███████▌           ▐███████▌
   out               across, twice";

const FIST: &str = "\
 close, open, four times

  █ █ █ █            ▗▄▄▄▄▄▄▖
 ▐█▄█▄█▄█▌           ▐█▌█▌█▌█▌
▚▐███████▌   ⇄       ▐▀▀▀▀▀▀▀▌
 ▀███████▌           ▐▄▄▄▄▄▄▄▌
   open                 fist";

const FREE: &str = "\
 as you like

  ▖ █ ▖ ▗             spread,
 ▐█▄█▄█▄▛▌            gather,
▚▐███████▌            point,
 ▀███████▌            grasp …";

/// What the hand looks like in a step; in the turn, where it should go.
pub fn drawing(step: Step, turning: Option<&str>) -> &'static str {
    match (step, turning) {
        (Step::Turn, Some("fingers up")) => FINGERS_UP,
        (Step::Turn, Some("fingers down")) => FINGERS_DOWN,
        (Step::Turn, Some(way)) if way.contains("palm is up") => PALM_UP,
        (Step::Turn, Some(way)) if way.contains("palm down") => PALM_DOWN,
        (Step::Turn, _) => THUMB_UP,
        (Step::FirstFlat | Step::SecondFlat | Step::LastFlat, _) => FLAT,
        (Step::Thumb, _) => THUMB,
        (Step::Alone(_), _) => BEND,
        (Step::Fists, _) => FIST,
        (Step::Free, _) => FREE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::calibration::guide::{PLAN, plan};

    #[test]
    fn every_step_has_a_drawing_that_fits() {
        let turns = (0..13_000)
            .step_by(100)
            .map(|at| (Step::Turn, Some(plan::turning(at))));
        for (step, way) in PLAN.iter().map(|part| (part.step, None)).chain(turns) {
            let drawn = drawing(step, way);
            assert!(drawn.lines().count() <= ROWS.into(), "{drawn}");
            assert!(
                drawn
                    .lines()
                    .all(|line| line.chars().count() <= COLUMNS.into()),
                "{drawn}"
            );
        }
        let all: std::collections::BTreeSet<_> = (0..13_000)
            .step_by(100)
            .map(|at| drawing(Step::Turn, Some(plan::turning(at))))
            .collect();
        assert_eq!(all.len(), 5);
    }

    #[test]
    fn a_finger_that_is_bent_alone_is_not_drawn_as_the_thumb_across_the_palm() {
        for part in PLAN
            .iter()
            .filter(|part| matches!(part.step, Step::Alone(_)))
        {
            assert_eq!(drawing(part.step, None), BEND);
        }
    }

    #[test]
    fn the_page_for_users_has_the_same_drawings() {
        let page = include_str!("../../../../docs/calibrate.md");
        for drawn in [
            FLAT,
            THUMB_UP,
            PALM_UP,
            FINGERS_UP,
            FINGERS_DOWN,
            BEND,
            THUMB,
            FIST,
        ] {
            assert!(page.contains(drawn), "docs/calibrate.md lacks\n{drawn}");
        }
    }
}
