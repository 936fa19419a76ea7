//! Every lens over its whole domain, and tables of bird's-eye views through them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

use std::f64::consts::PI;

use ipm_rs::error::LensError;
use ipm_rs::{
    BevGrid, BrownConrady, Camera, Cylindrical, Division, DoubleSphere, Equirectangular, Error, Eucm, FTheta,
    FThetaForm, Fov, Ground, InverseBrownConrady, KannalaBrandt, Lens, Lut, Mei, Ocam, Pinhole, RadialPolynomial,
    SampleAt, ThinPrismFisheye,
};
use nalgebra::Vector3;
use proptest::prelude::*;

/// KITTI raw, camera 2 of 2011_09_26.
const KITTI: [f64; 5] = [-3.691481e-01, 1.968681e-01, 1.353473e-03, 5.677587e-04, -6.770705e-02];

fn direction(angle: f64, azimuth: f64) -> Vector3<f64> {
    Vector3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos())
}

/// How far the image at m moves for a radian towards the axis.
fn slope(lens: &Lens, angle: f64, azimuth: f64, m: [f64; 2]) -> f64 {
    let h = 1e-7f64.min(0.25 * (lens.max_angle() - angle)).max(1e-15);
    lens.project(&direction(angle - h, azimuth)).map_or(0.0, |n| (m[0] - n[0]).hypot(m[1] - n[1]) / h)
}

/// Any lens of any model, with parameters as real ones have them, and the focal length of its K.
fn any_lens() -> impl Strategy<Value = (Lens, f64)> {
    let small = -0.01..0.01;
    let brown = (-0.5..0.3, -0.2..0.3, small.clone(), small.clone(), -0.1..0.1)
        .prop_map(|(k1, k2, p1, p2, k3)| (BrownConrady::new(&[k1, k2, p1, p2, k3], None).unwrap().into(), 1000.0));
    let rational = (prop::array::uniform3(-0.3..0.3), prop::array::uniform3(-0.2..0.4), small.clone(), small.clone())
        .prop_map(|(k, d, p1, p2)| {
            (BrownConrady::new(&[k[0], k[1], p1, p2, k[2], d[0], d[1], d[2]], None).unwrap().into(), 1000.0)
        });
    let prism =
        (-0.4..0.2, -0.1..0.2, prop::array::uniform4(-0.01..0.01), prop::array::uniform4(-0.1..0.1), small.clone())
            .prop_map(|(k1, k2, s, tilt, p1): (f64, f64, [f64; 4], [f64; 4], f64)| {
                let c = [k1, k2, p1, -p1, 0.0, 0.0, 0.0, 0.0, s[0], s[1], s[2], s[3], tilt[0], tilt[1]];
                (BrownConrady::new(&c, None).unwrap().into(), 1000.0)
            });
    let kannala =
        prop::array::uniform4(-0.05..0.05).prop_map(|k| (KannalaBrandt::new(&k, None).unwrap().into(), 350.0));
    let mei = (0.3..3.0, -0.3..0.3, -0.1..1.0, -1e-3..1e-3)
        .prop_map(|(xi, k1, k2, p)| (Mei::new(xi, &[k1, k2, p, -p], None).unwrap().into(), 900.0));
    let double =
        (-0.6..0.9, 0.0..=1.0).prop_map(|(xi, alpha)| (DoubleSphere::new(xi, alpha, None).unwrap().into(), 350.0));
    let eucm = (0.0..=1.0, 0.5..2.0).prop_map(|(alpha, beta)| (Eucm::new(alpha, beta, None).unwrap().into(), 350.0));
    let radial = (200.0..500.0, -50.0..20.0, -20.0..50.0, -10.0..5.0)
        .prop_map(|(a, b, c, d)| (RadialPolynomial::new(&[a, b, c, d], None).unwrap().into(), 1.0));
    let ocam = (200.0..500.0, 0.0..2e-3, -2e-6..2e-6, 0.0..3e-9, -0.01..0.01).prop_map(
        |(a0, a2, a3, a4, e): (f64, f64, f64, f64, f64)| {
            (Ocam::new(&[-a0, 0.0, a2, a3, a4], [1.0 + e, e, -e], None).unwrap().into(), 1.0)
        },
    );
    let forward = (200.0..900.0, -40.0..40.0, -30.0..30.0, -10.0..10.0, -0.02..0.02).prop_map(|(a, b, c, d, e)| {
        let lens = FTheta::new(&[0.0, a, b, c, d], FThetaForm::Forward, [1.0 + e, e, -e], None);
        (lens.unwrap().into(), 1.0)
    });
    let backward = (1e-3..5e-3, -1e-7..1e-7, -1e-9..1e-9, -1e-12..1e-12, -0.02..0.02).prop_map(|(a, b, c, d, e)| {
        let lens = FTheta::new(&[0.0, a, b, c, d], FThetaForm::Backward, [1.0 - e, e, e], None);
        (lens.unwrap().into(), 1.0)
    });
    let fov = (1e-3..3.0).prop_map(|omega| (Fov::new(omega, None).unwrap().into(), 500.0));
    let division = (-2.0..0.5).prop_map(|k| (Division::new(k, None).unwrap().into(), 500.0));
    let inverse = (-0.3..0.3, -0.2..0.2, small.clone(), small.clone(), -0.1..0.1).prop_map(|(k1, k2, p1, p2, k3)| {
        (InverseBrownConrady::new(&[k1, k2, p1, p2, k3], None).unwrap().into(), 600.0)
    });
    let thin = (prop::array::uniform4(-0.05..0.05), prop::array::uniform4(-0.01..0.01)).prop_map(|(k, p)| {
        let c = [k[0], k[1], p[0], p[1], k[2] * 0.1, k[3] * 0.01, p[2], p[3]];
        (ThinPrismFisheye::new(&c, None).unwrap().into(), 350.0)
    });
    let aria = (prop::array::uniform6(-0.02..0.02), prop::array::uniform6(-0.003..0.003)).prop_map(|(k, p)| {
        let c = [k[0], k[1], k[2], k[3] * 0.1, k[4] * 0.01, k[5] * 1e-3, p[0], p[1], p[2], p[3], p[4], p[5]];
        (ThinPrismFisheye::new(&c, None).unwrap().into(), 350.0)
    });
    let old = prop_oneof![brown, rational, prism, kannala, mei, double, eucm, radial, ocam];
    prop_oneof![old, forward, backward, fov, division, inverse, thin, aria]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    /// Project after unproject over the whole domain, to 1e-9 px: wherever a direction fixes the pixel so well. A
    /// direction is known to 1e-16; near an edge where the image runs away, or where Ocam's angle stands still, that is
    /// more than 1e-9 px, and the bound grows with it.
    #[test]
    fn there_and_back((lens, focal) in any_lens(), part in 0.0..1.0f64, azimuth in -PI..PI, edge in 0..3u8) {
        let angle = lens.max_angle() * match edge { 0 => part, 1 => 1.0 - part * 1e-3, _ => 1.0 - 1e-12 - part * 1e-9 };
        let ray = direction(angle, azimuth);
        let Some(m) = lens.project(&ray) else {
            // the last 1e-8 of a stereographic lens run away to infinity
            prop_assert!(angle > lens.max_angle() * (1.0 - 1e-7), "{lens} {angle}");
            return Ok(());
        };
        let slope = slope(&lens, angle, azimuth, m);
        let tolerance = 1e-9 + focal * slope * 4e-15;
        if focal * m[0].hypot(m[1]) > 1e6 { return Ok(()); }
        let back = lens.unproject(m);
        prop_assert!(back.is_some(), "{lens} {angle} of {}", lens.max_angle());
        let again = lens.project(&back.unwrap()).unwrap();
        let error = focal * (again[0] - m[0]).hypot(again[1] - m[1]);
        prop_assert!(error < tolerance, "{lens} {angle} of {}: {error:e} px, allowed {tolerance:e}", lens.max_angle());
        // and the direction itself, but for the edge, where the image hardly moves with it
        if angle < 0.98 * lens.max_angle() {
            let error = (back.unwrap() - ray).norm();
            prop_assert!(error < 1e-10 + 1e-12 * m[0].hypot(m[1]) / slope, "{lens} {angle}: {error:e}");
        }
    }

    /// No two directions share an image: along every azimuth the image moves on, and it does not fold sideways.
    #[test]
    fn the_image_does_not_fold((lens, _) in any_lens(), part in 0.0..1.0f64, azimuth in -PI..PI) {
        let h = 1e-6;
        let angle = (lens.max_angle() * part).clamp(2.0 * h, lens.max_angle() * (1.0 - 1e-5) - 2.0 * h);
        let at = |angle, azimuth| lens.project(&direction(angle, azimuth));
        let (Some(a), Some(b)) = (at(angle - h, azimuth), at(angle + h, azimuth)) else { return Ok(()) };
        let (Some(c), Some(d)) = (at(angle, azimuth - h), at(angle, azimuth + h)) else { return Ok(()) };
        let outwards = [b[0] - a[0], b[1] - a[1]];
        let sideways = [d[0] - c[0], d[1] - c[1]];
        prop_assert!(outwards[0] * sideways[1] - outwards[1] * sideways[0] > 0.0, "{lens} {angle} of {}", lens.max_angle());
    }

    /// Double spheres and EUCMs that see almost straight behind, where sums of what differs in sign lose their digits: within
    /// 3e-3 of there and of the edge, the image of the direction of an image is that image.
    #[test]
    fn there_and_back_almost_straight_behind(
        (near, off, sign) in (0..2u8, -12.0..-1.0f64, prop::bool::ANY),
        xi in -0.999..1.0f64,
        beta in 0.5..2.0f64,
        (gap, edge) in (-8.0..-2.5f64, prop::bool::ANY),
        azimuth in -PI..PI,
    ) {
        let off = 10f64.powf(off) * if sign { 1.0 } else { -1.0 };
        let xi = if near == 0 { xi } else { 1.0 - off.abs() };
        for lens in [
            Lens::from(DoubleSphere::new(xi, 0.5, None).unwrap()),
            DoubleSphere::new(xi, 0.5 + off, None).unwrap().into(),
            DoubleSphere::new(1.0, 0.5, None).unwrap().into(),
            Eucm::new(0.5, beta, None).unwrap().into(),
            Eucm::new(0.5 + off, beta, None).unwrap().into(),
        ] {
            let gap = if edge { 10f64.powf(gap) * 0.1 } else { 10f64.powf(gap).max(1e-7) };
            let angle = if edge { lens.max_angle() - gap } else { PI - gap };
            if angle > lens.max_angle() || PI - angle < 1e-7 { continue; }
            let m = lens.project(&direction(angle, azimuth));
            prop_assert!(m.is_some(), "{lens} {angle}");
            let m = m.unwrap();
            let back = lens.unproject(m);
            prop_assert!(back.is_some(), "{lens} {gap:e} {edge}");
            let again = lens.project(&back.unwrap()).unwrap();
            let tolerance = 1e-9 + 350.0 * slope(&lens, angle, azimuth, m) * 4e-15;
            let error = 350.0 * (again[0] - m[0]).hypot(again[1] - m[1]);
            prop_assert!(error < tolerance || 350.0 * m[0].hypot(m[1]) > 1e6, "{lens} {gap:e} {edge}: {error:e}");
        }
    }

    /// What has no direction is refused, and what is given one is its image.
    #[test]
    fn outside_there_is_nothing((lens, focal) in any_lens(), u in -3.0..3.0f64, v in -3.0..3.0f64, out in 0.0..1.0f64) {
        let unit = 1000.0 / focal;
        let m = if focal == 1.0 { [u * 400.0, v * 400.0] } else { [u * unit, v * unit] };
        if let Some(ray) = lens.unproject(m) {
            prop_assert!((ray.norm() - 1.0).abs() < 1e-15 * 4.0);
            prop_assert!(ray.x.hypot(ray.y).atan2(ray.z) <= lens.max_angle() + 1e-12);
        }
        let end = lens.max_angle();
        let beyond = end + (PI - end) * out + 1e-9;
        if beyond < PI {
            prop_assert_eq!(lens.project(&direction(beyond, u)), None);
        }
        prop_assert_eq!(lens.project(&Vector3::zeros()), None);
        prop_assert_eq!(lens.project(&Vector3::new(f64::NAN, 0.0, 1.0)), None);
        prop_assert_eq!(lens.unproject([f64::NAN, 0.0]), None);
        prop_assert_eq!(lens.unproject([f64::INFINITY, 0.0]), None);
    }

    /// A direction has no length.
    #[test]
    fn length_does_not_matter((lens, focal) in any_lens(), part in 0.0..0.95f64, azimuth in -PI..PI, power in -140..140i32) {
        let ray = direction(lens.max_angle() * part, azimuth);
        let (m, scaled) = (lens.project(&ray).unwrap(), lens.project(&(ray * 10f64.powi(power))).unwrap());
        prop_assert!((m[0] - scaled[0]).hypot(m[1] - scaled[1]) * focal < 1e-8 * (1.0 + m[0].hypot(m[1])), "{lens}");
    }
}

fn kitti_camera() -> Camera {
    let model = Pinhole::new(959.791, 956.9251, 696.0217, 224.1806, 0.0).unwrap();
    let lens = BrownConrady::new(&KITTI, None).unwrap();
    Camera::from_euler(model, (1392, 512), [0.0, 0.0, 1.65], 0.0, 0.0, 0.0).unwrap().with_lens(Lens::from(lens))
}

#[test]
fn the_fold_over_point_is_invalid() {
    // (8, 1.65, 5) in the camera frame is 58.5 degrees off the axis; the bare formula puts it inside the image
    let camera = kitti_camera();
    let point = Vector3::new(5.0, -8.0, 0.0); // the same in the vehicle frame, on the road
    let seen = camera.project(&point);
    assert!(!seen.valid && seen.pixel[0].is_nan() && seen.depth == 5.0);
    assert!(camera.project(&Vector3::new(5.0, -5.0, 0.0)).pixel[0].is_finite());
    assert!(camera.project(&Vector3::new(-5.0, 0.3, 0.0)).pixel[0].is_nan(), "behind");
}

/// Every valid cell's pixel looks back at that cell's road point: nothing is painted twice, mirrored or in rings.
fn no_ghosts(camera: &Camera) -> usize {
    let grid = BevGrid::new((-30.0, 30.0), (-30.0, 30.0), (0.25, 0.25), SampleAt::Center).unwrap();
    let ground = Ground::default();
    let lut = Lut::new(camera, &grid, &ground).unwrap();
    let (map_x, map_y) = lut.maps(f32::NAN).unwrap();
    let mask = lut.mask().unwrap();
    for cell in (0..mask.len()).filter(|&cell| mask[cell]) {
        let (row, column) = (cell / grid.columns(), cell % grid.columns());
        let [x, y] = grid.ground_from_cell([row as f64, column as f64]);
        let exact = camera.project(&Vector3::new(x, y, 0.0)).pixel;
        assert!((exact[0] - f64::from(map_x[cell])).abs() < 2e-3 && (exact[1] - f64::from(map_y[cell])).abs() < 2e-3);
        let back = camera.ground_from_pixel(exact, &ground);
        let back = back.unwrap_or_else(|| panic!("{camera}: ({x}, {y}) seen at {exact:?}, which sees no road"));
        assert!((back.x - x).hypot(back.y - y) < 1e-6 * (1.0 + x.hypot(y)), "{camera}: ({x}, {y}) seen as {back}");
    }
    mask.iter().filter(|&&valid| valid).count()
}

#[test]
fn views_all_round_have_no_ghosts() {
    let camera = |focal: f64, size: (u32, u32), pitch: f64, lens: Lens| {
        let (cx, cy) = (f64::from(size.0) / 2.0 - 0.5, f64::from(size.1) / 2.0 - 0.5);
        let model = Pinhole::new(focal, focal, cx, cy, 0.0).unwrap();
        Camera::from_euler(model, size, [0.5, 0.2, 1.4], 0.03, pitch, 0.4).unwrap().with_lens(lens)
    };
    let wide = BrownConrady::new(&[-0.33, 0.13, 1e-3, -5e-4, -0.02], None).unwrap();
    let strong = BrownConrady::new(&[-0.4, 0.1, 0.0, 0.0], None).unwrap();
    let fisheye = KannalaBrandt::new(&[-0.02, 0.004, -0.003, 0.0004], None).unwrap();
    let folding = KannalaBrandt::new(&[-0.12, 0.0, 0.0, 0.0], None).unwrap();
    for (camera, least) in [
        (camera(500.0, (1280, 960), 0.2, wide.into()), 5000),
        (camera(400.0, (1280, 960), 0.5, strong.into()), 2000),
        (camera(330.0, (1280, 960), 0.4, fisheye.into()), 10_000),
        (camera(330.0, (1280, 960), 1.2, folding.into()), 10_000),
        (camera(1300.0, (1400, 1400), 0.3, Mei::new(2.2, &[0.016, 1.65, 4e-4, -5e-4], None).unwrap().into()), 10_000),
        (camera(350.0, (1280, 960), 0.8, DoubleSphere::new(-0.2, 0.6, None).unwrap().into()), 10_000),
        (camera(350.0, (1280, 960), 0.8, Eucm::new(0.6, 1.1, None).unwrap().into()), 10_000),
        (
            camera(1.0, (1280, 966), 0.4, RadialPolynomial::new(&[340.0, -32.0, 48.0, -7.2], None).unwrap().into()),
            10_000,
        ),
        (
            camera(
                1.0,
                (1280, 960),
                0.4,
                Ocam::new(&[-350.0, 0.0, 1e-3, -1e-6, 1e-9], [1.0, 0.0, 0.0], None).unwrap().into(),
            ),
            10_000,
        ),
        (
            camera(
                1.0,
                (1280, 960),
                0.4,
                FTheta::new(&[0.0, 340.0, 5.0, -8.0, 1.0], FThetaForm::Forward, [1.01, 2e-3, -3e-3], None)
                    .unwrap()
                    .into(),
            ),
            10_000,
        ),
        (
            camera(
                1.0,
                (1280, 960),
                0.4,
                FTheta::new(&[0.0, 2.9e-3, 1e-8, 1e-10], FThetaForm::Backward, [1.0, 0.0, 0.0], None).unwrap().into(),
            ),
            10_000,
        ),
        (camera(450.0, (1280, 960), 0.5, Fov::new(1.1, None).unwrap().into()), 5000),
        (camera(450.0, (1280, 960), 0.5, Division::new(-0.4, None).unwrap().into()), 10_000),
        (
            camera(
                600.0,
                (1280, 960),
                0.5,
                InverseBrownConrady::new(&[-0.2, 0.05, 1e-3, -2e-3, 0.0], None).unwrap().into(),
            ),
            3000,
        ),
        (
            camera(
                350.0,
                (1280, 960),
                0.6,
                ThinPrismFisheye::new(&[0.01, -0.02, 1e-3, -2e-3, 3e-3, -1e-3, 4e-3, -5e-3], None).unwrap().into(),
            ),
            10_000,
        ),
        (camera(203.7, (1280, 640), 0.3, Equirectangular::new(None).unwrap().into()), 20_000),
        (camera(203.7, (1280, 960), 0.3, Cylindrical::new(None).unwrap().into()), 20_000),
    ] {
        let valid = no_ghosts(&camera);
        assert!(valid > least, "{camera}: {valid}");
    }
}

#[test]
fn a_fisheye_sees_behind_its_own_plane() {
    let lens = KannalaBrandt::new(&[0.0; 4], None).unwrap();
    let model = Pinhole::new(300.0, 300.0, 639.5, 639.5, 0.0).unwrap();
    let camera = Camera::from_euler(model, (1280, 1280), [0.0; 3], 0.0, 0.0, 0.0).unwrap().with_lens(Lens::from(lens));
    let seen = camera.project(&Vector3::new(-1.0, 5.0, 0.0));
    assert!(seen.valid && seen.depth == -1.0);
    let angle = 5f64.atan2(-1.0);
    assert!((seen.pixel[0] - (639.5 - 300.0 * angle)).abs() < 1e-9 && (seen.pixel[1] - 639.5).abs() < 1e-9);
    // straight behind, where every azimuth meets, there is nothing
    assert!(!camera.project(&Vector3::new(-1.0, 0.0, 0.0)).valid);
}

/// Far out a tolerance that grows with the square would let any answer pass.
#[test]
fn pixels_beyond_everything_have_no_direction() {
    let lenses: [Lens; 6] = [
        KannalaBrandt::new(&[0.0; 4], Some(0.5)).unwrap().into(),
        RadialPolynomial::new(&[300.0, 0.0, 0.0, 0.0], None).unwrap().into(),
        BrownConrady::new(&KITTI, None).unwrap().into(),
        BrownConrady::new(&[0.1, 0.0, 0.0, 0.0], None).unwrap().into(),
        Eucm::new(0.6, 1.1, None).unwrap().into(),
        Ocam::new(&[300.0, 0.0, -1e-3], [1.0, 0.0, 0.0], None).unwrap().into(),
    ];
    for lens in lenses {
        for power in [19, 25, 60, 150, 200, 300] {
            assert_eq!(lens.unproject([10f64.powi(power), 1.0]), None, "{lens} 1e{power}");
        }
    }
    // a pinhole's directions come ever closer to 90 degrees
    let pinhole: Lens = BrownConrady::new(&[0.0; 4], None).unwrap().into();
    for power in [3, 9, 15, 60] {
        let m = 10f64.powi(power);
        let [x, y] = pinhole.project(&pinhole.unproject([m, 1.0]).unwrap()).unwrap();
        assert!((x / m - 1.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12, "1e{power}");
    }
}

#[test]
fn a_limit_makes_the_domain_smaller_and_never_larger() {
    for angle in [0.1, 0.7, 1.2] {
        let lenses: [Lens; 15] = [
            BrownConrady::new(&[-0.01, 0.0, 0.0, 0.0], Some(angle)).unwrap().into(),
            KannalaBrandt::new(&[-0.01, 0.0, 0.0, 0.0], Some(angle)).unwrap().into(),
            Mei::new(1.2, &[0.0; 4], Some(angle)).unwrap().into(),
            DoubleSphere::new(-0.2, 0.6, Some(angle)).unwrap().into(),
            Eucm::new(0.6, 1.1, Some(angle)).unwrap().into(),
            RadialPolynomial::new(&[340.0, -32.0, 48.0, -7.2], Some(angle)).unwrap().into(),
            Ocam::new(&[-350.0, 0.0, 1e-3], [1.0, 0.0, 0.0], Some(angle)).unwrap().into(),
            FTheta::new(&[0.0, 340.0, -8.0], FThetaForm::Forward, [1.0, 0.0, 0.0], Some(angle)).unwrap().into(),
            FTheta::new(&[0.0, 3e-3, 1e-8], FThetaForm::Backward, [1.0, 0.0, 0.0], Some(angle)).unwrap().into(),
            Fov::new(0.9, Some(angle)).unwrap().into(),
            Division::new(-0.3, Some(angle)).unwrap().into(),
            InverseBrownConrady::new(&[0.05, 0.0, 0.0, 0.0], Some(angle)).unwrap().into(),
            ThinPrismFisheye::new(&[0.0; 8], Some(angle)).unwrap().into(),
            Cylindrical::new(Some(angle)).unwrap().into(),
            Equirectangular::new(Some(angle)).unwrap().into(),
        ];
        for lens in lenses {
            assert!((lens.max_angle() - angle).abs() < 1e-12, "{lens} {}", lens.max_angle());
            assert!(lens.project(&direction(angle - 1e-9, 2.0)).is_some(), "{lens}");
            assert!(lens.project(&direction(angle + 1e-9, 2.0)).is_none(), "{lens}");
        }
    }
    let free = KannalaBrandt::new(&[-0.1, 0.0, 0.0, 0.0], None).unwrap();
    let wide = KannalaBrandt::new(&[-0.1, 0.0, 0.0, 0.0], Some(3.0)).unwrap();
    assert_eq!(free.max_angle(), wide.max_angle());
}

#[test]
fn vectors_of_other_implementations() {
    // KITTI-360 image_02, cv2.omnidir and the data set's own formula
    let lens: Lens = Mei::new(
        2.213404750785489,
        &[0.01679823566011368, 1.6548773243373522, 4.2223943394772046e-04, 4.2462134260997584e-04],
        None,
    )
    .unwrap()
    .into();
    let model = Pinhole::new(1336.3220825849971, 1335.7883350012958, 716.9432351012632, 705.7649830822159, 0.0);
    let camera = Camera::new(model.unwrap(), (1400, 1400), Camera::forward_pose()).unwrap().with_lens(lens);
    for (ray, pixel) in [
        ([1.0, 0.0, 1.0], [1042.7485, 705.7980]),
        ([0.0, 1.0, 1.0], [716.9765, 1031.4395]),
        ([1.0, 0.0, 0.0], [1364.7281, 705.8801]),
    ] {
        let [x, y, z] = ray;
        let got = camera.project(&Vector3::new(z, -x, -y)).pixel;
        assert!((got[0] - pixel[0]).abs() < 1e-3 && (got[1] - pixel[1]).abs() < 1e-3, "{got:?} {pixel:?}");
    }
    assert!((lens.max_angle().to_degrees() - 116.9).abs() < 0.05);
}

/// Longitude and latitude are linear in the pixel, and the whole sphere is on the image.
#[test]
fn panoramas_are_there_and_back_to_all_sides() {
    for (index, lens) in [Lens::from(Equirectangular::new(None).unwrap()), Cylindrical::new(None).unwrap().into()]
        .into_iter()
        .enumerate()
    {
        for i in 0..2000 {
            let longitude = (f64::from(i) * 0.618_034).fract() * 2.0 * PI - PI;
            let latitude = ((f64::from(i) * 0.414_214).fract() - 0.5) * 3.1;
            let (sin, cos) = longitude.sin_cos();
            let ray = Vector3::new(sin * latitude.cos(), latitude.sin(), cos * latitude.cos()) * 3.7;
            let m = lens.project(&ray).unwrap();
            let down = if index == 0 { latitude } else { latitude.tan() };
            assert!((m[0] - longitude).abs() < 1e-15 * 4.0, "{lens} {longitude}");
            assert!((m[1] - down).abs() < 1e-15 * (4.0 + 4.0 * down * down), "{lens} {latitude}");
            assert!((lens.unproject(m).unwrap() - ray.normalize()).norm() < 2e-15, "{lens} {longitude} {latitude}");
        }
        assert_eq!(lens.unproject([3.2, 0.0]), None);
        assert_eq!(lens.max_angle(), PI);
        assert!(lens.project(&Vector3::new(0.0, 0.0, -1.0)).is_some(), "straight behind is on the seam");
        assert_eq!(lens.project(&Vector3::new(0.0, 1.0, 0.0)).is_some(), index == 0, "straight down");
        assert_eq!(lens.project(&Vector3::zeros()), None);
    }
    let sphere = Lens::from(Equirectangular::new(None).unwrap());
    assert_eq!(sphere.project(&Vector3::new(0.0, -2.0, 0.0)), Some([0.0, -PI / 2.0]));
    assert_eq!(sphere.unproject([0.1, 1.6]), None);
}

#[test]
fn what_sees_nothing_beside_its_axis_is_refused() {
    let folded: [ipm_rs::Result<Lens>; 14] = [
        BrownConrady::new(&[0.0, 0.0, 1e4, 0.0], None).map(Into::into),
        BrownConrady::new(&[-1e7, 0.0, 0.0, 0.0], None).map(Into::into),
        // prism terms, found by scanning
        BrownConrady::new(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e4, 0.0, 0.0, 0.0], None).map(Into::into),
        BrownConrady::new(&[-1e7, 0.0, 0.0, 0.0], Some(0.5)).map(Into::into),
        KannalaBrandt::new(&[-1e9, 0.0, 0.0, 0.0], None).map(Into::into),
        Mei::new(1.2, &[0.0, 0.0, 1e4, 0.0], None).map(Into::into),
        DoubleSphere::new(-0.9999999999, 0.0, None).map(Into::into),
        RadialPolynomial::new(&[1.0, -1e4, 0.0, 0.0], None).map(Into::into),
        Ocam::new(&[300.0, 0.0, 1e6], [1.0, 0.0, 0.0], None).map(Into::into),
        FTheta::new(&[0.0, 300.0, -1e6], FThetaForm::Forward, [1.0, 0.0, 0.0], None).map(Into::into),
        FTheta::new(&[0.0, 3e-3, -1.0], FThetaForm::Backward, [1.0, 0.0, 0.0], None).map(Into::into),
        Division::new(1e9, None).map(Into::into),
        InverseBrownConrady::new(&[-1e7, 0.0, 0.0, 0.0], None).map(Into::into),
        ThinPrismFisheye::new(&[0.0, 0.0, 1e4, 0.0, 0.0, 0.0, 0.0, 0.0], None).map(Into::into),
    ];
    for (index, refused) in folded.into_iter().enumerate() {
        let Err(Error::Lens(LensError::Folds { angle, .. })) = refused else { panic!("{index}: {refused:?}") };
        assert!((0.0..1e-3).contains(&angle), "{index}: {angle}");
    }
    let named = Mei::new(1.2, &[0.0, 0.0, 1e4, 0.0], None).unwrap_err().to_string();
    assert!(named.starts_with("Mei: expected 4 (k1, k2, p1, p2)"), "{named}");
    // a limit may be as small as its caller wants
    assert_eq!(KannalaBrandt::new(&[0.1, 0.0, 0.0, 0.0], Some(1e-4)).unwrap().max_angle(), 1e-4);
}

proptest! {
    /// Whatever the numbers: a lens that sees something, or an error.
    #[test]
    fn no_lens_is_blind(
        values in prop::collection::vec((-300.0..300.0f64, -1.0..1.0f64), 14),
        count in prop::sample::select(vec![4usize, 5, 8, 12, 14]),
    ) {
        let c: Vec<f64> = values.iter().map(|&(power, part)| part * 10f64.powf(power)).collect();
        let lenses: [ipm_rs::Result<Lens>; 13] = [
            BrownConrady::new(&c[..count], None).map(Into::into),
            KannalaBrandt::new(&c[..4], None).map(Into::into),
            Mei::new(c[4].abs(), &c[..4], None).map(Into::into),
            Eucm::new(values[0].1.abs(), c[1].abs(), None).map(Into::into),
            RadialPolynomial::new(&[c[0].abs(), c[1], c[2], c[3]], None).map(Into::into),
            Ocam::new(&c[..count.min(12)], [1.0, 0.0, 0.0], None).map(Into::into),
            FTheta::new(&[&[0.0, c[0].abs()], &c[1..10]].concat(), FThetaForm::Forward, [1.0, 0.0, 0.0], None).map(Into::into),
            FTheta::new(&[&[0.0, c[0].abs()], &c[1..10]].concat(), FThetaForm::Backward, [1.0, 0.0, 0.0], None).map(Into::into),
            Fov::new(c[0].abs(), None).map(Into::into),
            Division::new(c[0], None).map(Into::into),
            InverseBrownConrady::new(&c[..5], None).map(Into::into),
            ThinPrismFisheye::new(&c[..8], None).map(Into::into),
            ThinPrismFisheye::new(&c[..12], None).map(Into::into),
        ];
        for lens in lenses.into_iter().flatten() {
            prop_assert!((1e-3..=PI).contains(&lens.max_angle()), "{lens}: {}", lens.max_angle());
            prop_assert!(lens.project(&direction(5e-4, 1.0)).is_some(), "{lens}: {}", lens.max_angle());
        }
    }
}

#[test]
fn wrong_parameters_are_refused() {
    let nan = f64::NAN;
    for count in [0, 1, 2, 3, 6, 7, 9, 11, 13, 15] {
        let refused = BrownConrady::new(&vec![0.0; count], None);
        assert!(matches!(refused, Err(Error::Lens(LensError::Coefficients { got, .. })) if got == count));
    }
    let wrong: Vec<(&str, ipm_rs::Result<Lens>)> = vec![
        ("NaN", BrownConrady::new(&[nan, 0.0, 0.0, 0.0], None).map(Into::into)),
        (
            "tilt",
            BrownConrady::new(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.6, 0.0], None)
                .map(Into::into),
        ),
        ("count", KannalaBrandt::new(&[0.0; 5], None).map(Into::into)),
        ("infinite", KannalaBrandt::new(&[0.0, f64::INFINITY, 0.0, 0.0], None).map(Into::into)),
        ("xi", Mei::new(-0.1, &[0.0; 4], None).map(Into::into)),
        ("xi", Mei::new(nan, &[0.0; 4], None).map(Into::into)),
        ("count", Mei::new(1.0, &[0.0; 5], None).map(Into::into)),
        ("alpha", DoubleSphere::new(0.0, 1.1, None).map(Into::into)),
        ("alpha", DoubleSphere::new(0.0, nan, None).map(Into::into)),
        ("xi", DoubleSphere::new(-1.0, 0.5, None).map(Into::into)),
        ("xi", DoubleSphere::new(1.1, 0.5, None).map(Into::into)),
        ("alpha", Eucm::new(-0.1, 1.0, None).map(Into::into)),
        ("beta", Eucm::new(0.5, 0.0, None).map(Into::into)),
        ("k1", RadialPolynomial::new(&[0.0, 1.0, 1.0, 1.0], None).map(Into::into)),
        ("k1", RadialPolynomial::new(&[-340.0, 1.0, 1.0, 1.0], None).map(Into::into)),
        ("a0", Ocam::new(&[0.0, 1.0], [1.0, 0.0, 0.0], None).map(Into::into)),
        ("none", Ocam::new(&[], [1.0, 0.0, 0.0], None).map(Into::into)),
        ("many", Ocam::new(&[1.0; 13], [1.0, 0.0, 0.0], None).map(Into::into)),
        ("affine", Ocam::new(&[-300.0], [0.0, 0.0, 0.0], None).map(Into::into)),
        ("affine", Ocam::new(&[-300.0], [1.0, nan, 0.0], None).map(Into::into)),
        ("none", FTheta::new(&[0.0], FThetaForm::Forward, [1.0, 0.0, 0.0], None).map(Into::into)),
        ("many", FTheta::new(&[0.0; 13], FThetaForm::Forward, [1.0, 0.0, 0.0], None).map(Into::into)),
        ("a0", FTheta::new(&[1.0, 300.0], FThetaForm::Forward, [1.0, 0.0, 0.0], None).map(Into::into)),
        ("a1", FTheta::new(&[0.0, -300.0], FThetaForm::Forward, [1.0, 0.0, 0.0], None).map(Into::into)),
        ("form", FTheta::new(&[0.0, 3e-3], FThetaForm::Forward, [1.0, 0.0, 0.0], None).map(Into::into)),
        ("form", FTheta::new(&[0.0, 300.0], FThetaForm::Backward, [1.0, 0.0, 0.0], None).map(Into::into)),
        ("linear", FTheta::new(&[0.0, 300.0], FThetaForm::Forward, [-1.0, 0.0, 0.0], None).map(Into::into)),
        ("omega", Fov::new(0.0, None).map(Into::into)),
        ("omega", Fov::new(3.2, None).map(Into::into)),
        ("omega", Fov::new(nan, None).map(Into::into)),
        ("k", Division::new(nan, None).map(Into::into)),
        ("count", InverseBrownConrady::new(&[0.0; 8], None).map(Into::into)),
        ("count", ThinPrismFisheye::new(&[0.0; 10], None).map(Into::into)),
        ("limit", Cylindrical::new(Some(0.0)).map(Into::into)),
        ("limit", Equirectangular::new(Some(4.0)).map(Into::into)),
        ("limit", Eucm::new(0.5, 1.0, Some(0.0)).map(Into::into)),
        ("limit", Eucm::new(0.5, 1.0, Some(3.2)).map(Into::into)),
        ("limit", Ocam::new(&[-300.0], [1.0, 0.0, 0.0], Some(nan)).map(Into::into)),
    ];
    for (what, refused) in wrong {
        assert!(
            matches!(
                refused,
                Err(Error::Lens(LensError::Coefficients { .. }) | Error::Lens(LensError::Parameter { .. }))
            ),
            "{what}"
        );
    }
}
