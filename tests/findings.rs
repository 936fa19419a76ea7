//! What is odd about a camera or a table is said in words that name the numbers, what causes them and what mends them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]
use ipm_rs::{BevGrid, Camera, Finding, Ground, KannalaBrandt, Lut, Pinhole, SampleAt, Unseen};

fn of_intrinsics(fx: f64, fy: f64, cx: f64, cy: f64) -> String {
    let camera = Camera::new(Pinhole::new(fx, fy, cx, cy, 0.0).unwrap(), (1280, 720), Camera::forward_pose()).unwrap();
    let odd = camera.plausibility().unwrap();
    assert_eq!(odd.len(), 1, "{odd:?}");
    odd[0].to_string()
}

#[track_caller]
fn says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in: {text}");
    }
}

#[test]
fn intrinsics() {
    // a hair above 8, which nobody wants to read
    says(
        &of_intrinsics(8.000_000_000_1, 9.0, 640.0, 360.0),
        &["focal length of 8 pixels", "0.63 % of the image's width of 1280"],
    );
    says(&of_intrinsics(900.0, 500.0, 640.0, 360.0), &["fx is 1.80 times fy (fx 900, fy 500)", "camera.resized()"]);
    says(&of_intrinsics(900.0, 900.0, 0.51, 0.48), &["(0.51, 0.48)", "1280 x 720", "fraction * size - 0.5"]);
    says(
        &of_intrinsics(900.0, 900.0, 1215.5, 359.5),
        &["(1215.5, 359.5)", "95 % of the width and 50 % of the height", "camera.cropped()"],
    );
}

fn of_table(z: f64, pitch: f64, yaw: f64, road: f64) -> String {
    let model = Pinhole::new(1200.0, 1200.0, 639.5, 359.5, 0.0).unwrap();
    let camera = Camera::from_euler(model, (1280, 720), [1.2, -0.1, z], 0.0, pitch, yaw).unwrap();
    texts(&camera, &Ground::height(road).unwrap())
}

fn texts(camera: &Camera, ground: &Ground) -> String {
    let grid = BevGrid::new((5.0, 25.0), (-4.0, 4.0), (0.25, 0.25), SampleAt::Center).unwrap();
    let odd = Lut::new(camera, &grid, ground).unwrap().plausibility();
    odd.iter().map(Finding::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn cameras_and_their_roads() {
    // never "-0", nor the noise of a difference
    says(&of_table(0.3, 0.1, 0.0, 0.1 + 0.2), &["the camera, 0.3 m high, is not above the road at 0.3 m", "edge-on"]);
    says(&of_table(-0.0, 0.1, 0.0, 0.0), &["the camera, 0 m high", "the road at 0 m"]);
    says(&of_table(-1.4, -0.1, 0.0, 0.1), &["-1.4 m high", "road at 0.1 m, but 1.5 m under it", "as a ceiling"]);
}

#[test]
fn grids_that_nobody_sees() {
    let half_a_turn = std::f64::consts::PI;
    let behind = of_table(1.4, 0.1, half_a_turn, 0.0);
    says(
        &behind,
        &[
            "camera at (1.20, -0.10, 1.40) m",
            "180.0 degrees to the left of +x and 5.7 degrees down",
            "the whole grid is behind it",
        ],
    );
    says(
        &behind,
        &["the middle of its image's bottom row sees the road at (-2.2, -0.1) m", "check the grid's x and y"],
    );
    says(&of_table(1.4, 0.1, 1.47, 0.0), &["outside its image, beyond the right edge", "84.2 degrees to the left"]);
    says(
        &of_table(1.4, -0.9, -0.2, 0.0),
        &["beyond the bottom edge", "11.5 degrees to the right of +x and 51.6 degrees up", "sees no road"],
    );
    let narrow = KannalaBrandt::new(&[0.0; 4], Some(0.1)).unwrap();
    let model = Pinhole::new(1200.0, 1200.0, 639.5, 359.5, 0.0).unwrap();
    let camera = Camera::from_euler(model, (1280, 720), [1.2, -0.1, 1.4], 0.0, 0.1, 1.3).unwrap();
    says(&texts(&camera.with_lens(Some(narrow.into())), &Ground::default()), &["beyond the angles that its lens sees"]);
    let because = |because| {
        Finding::NoCell { because, position: [0.0; 3], optical_axis: [1.0, 0.0, 0.0], sees: None }.to_string()
    };
    says(&because(Unseen::Hidden), &["the road itself hides the grid, behind a crest"]);
    says(&because(Unseen::Unknown), &["the height map does not know the road there"]);
}
