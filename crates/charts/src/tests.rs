//! Drawings are whole SVG files with their data beside them; nothing odd in the data stops them.

use super::*;

#[test]
fn a_chart_draws_every_curve_and_leaves_its_data() {
    let curve = |name: &str, f: fn(f64) -> f64| Curve {
        name: name.to_owned(),
        points: (1..50).map(|i| (f64::from(i), f(f64::from(i)))).collect(),
    };
    let chart = Chart {
        title: "d-Knn, SP1".to_owned(),
        x_label: "epoch".to_owned(),
        y_label: "d-Knn".to_owned(),
        logarithmic: true,
        ceiling: Some(1e4),
        curves: vec![
            curve("HAE (adap)", |x| 100.0 / x),
            curve("Pin", |x| x * x),
            curve("not a number", |_| f64::NAN),
        ],
        ..Chart::default()
    };
    let Drawing { svg, csv } = charts(&[chart.clone(), Chart::default()]).unwrap();
    assert!(svg.trim_end().ends_with("</svg>") && svg.contains("HAE (adap)"));
    assert!(svg.matches("<polyline").count() >= 2);
    assert!(csv.starts_with("chart,curve,x,y\n\"d-Knn, SP1\",HAE (adap),1,100\n"));
    assert_eq!(csv.lines().count(), 1 + 3 * 49);
}

fn one_curve(name: &str, points: Vec<(f64, f64)>, colour: [u8; 3]) -> Chart {
    Chart {
        title: name.to_owned(),
        curves: vec![Curve {
            name: name.to_owned(),
            points,
        }],
        colours: vec![colour],
        note: "means over ten repetitions".to_owned(),
        ceiling: Some(150.0),
        ..Chart::default()
    }
}

fn drawn(charts_of: &[Chart]) -> String {
    charts(charts_of).unwrap().svg
}

#[test]
fn a_curve_keeps_its_colour_and_what_is_above_the_ceiling_is_told_once() {
    let red = one_curve(
        "Pin",
        vec![(1.0, 20_500.0), (2.0, 40.0), (3.0, 30.0)],
        [213, 74, 0],
    );
    let blue = one_curve("HAE", vec![(1.0, 9.0), (2.0, 8.0)], [0, 114, 178]);
    for charts in [[red.clone(), blue.clone()], [blue, red]] {
        let svg = drawn(&charts);
        let lines = |colour: &str| svg.matches(&format!("stroke=\"{colour}\"")).count();
        // The curve and its sign in the legend.
        assert_eq!((lines("#D54A00"), lines("#0072B2")), (2, 2));
        assert_eq!(svg.matches("means over ten repetitions").count(), 1);
        assert!(
            svg.contains("Pin: above 150, not drawn: (Pin, 1, 20500.0)"),
            "{svg}"
        );
        // Two of the three points.
        assert_eq!(svg.matches("fill=\"#D54A00\"").count(), 2);
    }
}

#[test]
fn four_charts_stand_in_two_rows_and_three_in_one() {
    let size = |count: usize| {
        let svg = drawn(&vec![one_curve("a", vec![(0.0, 1.0)], [0; 3]); count]);
        let number = |key: &str| -> u32 {
            let (_, rest) = svg.split_once(key).unwrap();
            rest.split('"').nth(1).unwrap().parse().unwrap()
        };
        (number(" width="), number(" height="))
    };
    let ((two, one_row), (three, also_one)) = (size(2), size(3));
    assert!(three > two && one_row == also_one);
    assert_eq!(size(4), (two, 2 * one_row - 30));
}

#[test]
fn panels_with_the_same_room_have_the_same_scale() {
    let square = |side: f32| {
        vec![
            vec![0.0, 0.0],
            vec![side, 0.0],
            vec![side, side],
            vec![0.0, side],
        ]
    };
    let side = |room: Points| -> i32 {
        let panel = Panel {
            outline: square(1.0),
            room,
            ..Panel::default()
        };
        let svg = panels(&[vec![panel]]).unwrap().svg;
        let (_, points) = svg.split_once("points=\"").unwrap();
        let across = points.split('"').next().unwrap().split_whitespace();
        let across: Vec<i32> = across
            .map(|point| point.split(',').next().unwrap().parse().unwrap())
            .collect();
        across.iter().max().unwrap() - across.iter().min().unwrap()
    };
    let (alone, beside) = (side(Points::default()), side(square(4.0)));
    assert!((alone - 4 * beside).abs() <= 4, "{alone} {beside}");
}

#[test]
fn a_sketch_has_its_key_and_round_joints() {
    let sketch = Sketch {
        title: "q1".to_owned(),
        strokes: vec![Stroke {
            points: vec![(0.1, 0.1), (0.5, 0.9), (0.9, 0.1)],
            colour: [40, 90, 170],
            width: 6,
        }],
        ..Sketch::default()
    };
    let key = [Key::line("thumb; finger A", [40, 90, 170])];
    let Drawing { svg, csv } = sketches(&[vec![sketch]], &key, "pair\n1\n".to_owned()).unwrap();
    assert!(svg.contains("thumb; finger A"));
    assert_eq!(
        (
            svg.matches("<circle").count(),
            svg.matches("<polyline").count()
        ),
        (3, 2)
    );
    assert_eq!(csv, "pair\n1\n".to_owned());
}

#[test]
fn a_panel_joins_neighbours_and_numbers_its_marks() {
    let points = vec![
        vec![0.0, 0.0, 1.0],
        vec![1.0, 0.0, 1.0],
        vec![0.0, 1.0, 1.0],
    ];
    let panel = Panel {
        title: "three".to_owned(),
        grid: vec![[0, 0], [1, 0], [0, 1]],
        heat: vec![0.0, 0.5, 1.0],
        marks: points.clone(),
        points,
        ..Panel::default()
    };
    let Drawing { svg, csv } = panels(&[vec![panel, Panel::default()], vec![]]).unwrap();
    // Two edges; the path of no points draws none.
    assert_eq!(svg.matches("<polyline").count(), 2, "{svg}");
    // A rim and a dot a mark.
    assert_eq!(svg.matches("<circle").count(), 2 * 3);
    assert!(csv.contains("three,point,1,1,0,1,0.5\n") && csv.contains("three,mark,2,0,1,1,\n"));
}
