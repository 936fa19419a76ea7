//! Area: means of footprints, and what must hold of them whatever the table.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

mod common;

use common::{image, seed_camera, seed_grid, textured};
use ipm_rs::error::{LutError, WarpError};
use ipm_rs::{Error, Ground, ImageView, ImageViewMut, Interpolation, Lut, Sample, WarpOptions};

const SIZE: (usize, usize) = (512, 256);

fn area<T: Sample>() -> WarpOptions<T> {
    WarpOptions { interpolation: Interpolation::Area, ..WarpOptions::default() }
}

/// The seed job in cells of many pixels, of a smaller image.
fn coarse() -> Lut {
    let camera = seed_camera().resized(SIZE.0 as u32, SIZE.1 as u32).unwrap();
    Lut::new(&camera, &seed_grid((0.5, 0.5)), &Ground::default()).unwrap()
}

/// An affine table: cell (row, column) samples at `from + column * along + row * down`.
fn affine(rows: usize, columns: usize, from: [f64; 2], along: [f64; 2], down: [f64; 2], source: (u32, u32)) -> Lut {
    let map = |axis: usize| -> Vec<f64> {
        let at = |row: usize, column: usize| from[axis] + column as f64 * along[axis] + row as f64 * down[axis];
        (0..rows).flat_map(|row| (0..columns).map(move |column| at(row, column))).collect()
    };
    Lut::from_maps(&map(0), &map(1), columns, source).unwrap()
}

#[test]
fn a_constant_image_stays_constant_to_the_last_bit() {
    let lut = coarse();
    let mask = lut.mask().unwrap();
    for value in 0..=255u8 {
        let pixels = vec![value; SIZE.0 * SIZE.1];
        let got = lut.warp(&image(&pixels, SIZE.0, SIZE.1, 1), &area()).unwrap();
        assert!(got.iter().zip(&mask).all(|(&got, &valid)| !valid || got == value), "{value}");
        let wide = vec![u16::from(value) * 257; SIZE.0 * SIZE.1];
        let got = lut.warp(&ImageView::new(&wide, SIZE, 1).unwrap(), &area()).unwrap();
        assert!(got.iter().zip(&mask).all(|(&got, &valid)| !valid || got == wide[0]), "{value}");
        let real = vec![f32::from(value) * 0.1 + 1e-3; SIZE.0 * SIZE.1];
        let got = lut.warp(&ImageView::new(&real, SIZE, 1).unwrap(), &area()).unwrap();
        assert!(got.iter().zip(&mask).all(|(&got, &valid)| !valid || got == real[0]), "{value}");
    }
}

#[test]
fn a_ramp_stays_a_ramp() {
    for (along, down) in
        [([9.0, 0.0], [0.0, 7.0]), ([13.0, 4.0], [-6.0, 5.0]), ([3.0, 2.0], [1.5, -2.5]), ([21.0, 0.4], [-17.0, 2.6])]
    {
        let lut = affine(
            12,
            12,
            [256.0 - 5.5 * (along[0] + down[0]), 128.0 - 5.5 * (along[1] + down[1])],
            along,
            down,
            (512, 256),
        );
        for (slope_x, slope_y) in [(0.3, 0.1), (0.05, 0.6), (0.25, 0.25), (0.4, 0.0)] {
            let exact = |x: f64, y: f64| 20.0 + slope_x * x + slope_y * y;
            let pixels: Vec<u8> = (0..SIZE.0 * SIZE.1)
                .map(|at| exact((at % SIZE.0) as f64, (at / SIZE.0) as f64).round() as u8)
                .collect();
            let got = lut.warp(&image(&pixels, SIZE.0, SIZE.1, 1), &area()).unwrap();
            let (xs, ys) = lut.maps(f32::NAN).unwrap();
            for (cell, &value) in got.iter().enumerate() {
                let expected = exact(f64::from(xs[cell]), f64::from(ys[cell]));
                let reach = |axis: usize| (along[axis].abs() + down[axis].abs()) / 2.0 + 2.0;
                let inside =
                    |at: f32, reach: f64, size: usize| f64::from(at) > reach && f64::from(at) < size as f64 - reach;
                if inside(xs[cell], reach(0), SIZE.0) && inside(ys[cell], reach(1), SIZE.1) {
                    assert!((f64::from(value) - expected).abs() <= 1.0, "{along:?} {down:?}: {value} for {expected}");
                }
            }
        }
    }
}

#[test]
fn footprints_are_means_of_what_they_cover() {
    let data = textured(SIZE.0 * SIZE.1);
    let view = image(&data, SIZE.0, SIZE.1, 1);
    // whole boxes of pixels: exact but for the fractions at their edges
    let (mut worst, mut cells): (f64, usize) = (0.0, 0);
    for (width, height) in [(8usize, 8usize), (16, 4), (12, 3), (32, 16), (64, 2)] {
        let (w, h) = (width as f64, height as f64);
        let (columns, rows) = (SIZE.0 / width, SIZE.1 / height);
        let lut = affine(rows, columns, [w / 2.0 - 0.5, h / 2.0 - 0.5], [w, 0.0], [0.0, h], (512, 256));
        let got = lut.warp(&view, &area()).unwrap();
        for row in 1..rows - 1 {
            for column in 1..columns - 1 {
                let pixels = (0..width * height).map(|at| (column * width + at % width, row * height + at / width));
                let sum: f64 = pixels.map(|(x, y)| f64::from(view.pixel(x, y)[0])).sum();
                worst = worst.max((f64::from(got[row * columns + column]) - sum / (w * h)).abs());
                cells += 1;
            }
        }
    }
    // noise of 74 grey levels: a mean of 64 pixels that took a quarter of them from beside the box would be off by 9
    assert!(cells > 2000 && worst < 18.0, "{worst} of {cells}");
}

#[test]
fn mass_is_conserved() {
    let data = textured(SIZE.0 * SIZE.1);
    let view = image(&data, SIZE.0, SIZE.1, 1);
    for (along, down) in
        [([4.0, 0.0], [0.0, 4.0]), ([10.0, 0.0], [0.0, 5.0]), ([16.0, 0.0], [0.0, 2.0]), ([5.0, 1.0], [-2.0, 6.0])]
    {
        let det: f64 = along[0] * down[1] - along[1] * down[0];
        let lut = affine(
            120,
            120,
            [256.0 - 59.5 * (along[0] + down[0]), 128.0 - 59.5 * (along[1] + down[1])],
            along,
            down,
            (512, 256),
        );
        let got = lut.warp(&view, &area()).unwrap();
        let mask = lut.mask().unwrap();
        let sum: f64 = got.iter().zip(&mask).filter(|&(_, &valid)| valid).map(|(&value, _)| f64::from(value)).sum();
        let cells = mask.iter().filter(|&&valid| valid).count() as f64;
        let mean = data.iter().map(|&value| f64::from(value)).sum::<f64>() / data.len() as f64;
        assert!((sum / cells / mean - 1.0).abs() < 0.005, "{along:?} {down:?} of {det}: {} for {mean}", sum / cells);
    }
}

#[test]
fn cells_no_larger_than_a_pixel_are_bilinear() {
    let data = textured(SIZE.0 * SIZE.1 * 3);
    let view = image(&data, SIZE.0, SIZE.1, 3);
    let lut = affine(100, 300, [3.2, 4.7], [0.9, 0.3], [-0.2, 1.0], (512, 256));
    assert_eq!(lut.warp(&view, &area()).unwrap(), lut.warp(&view, &WarpOptions::default()).unwrap());
}

#[test]
fn a_footprint_that_leaves_the_image_is_the_mean_of_the_rest() {
    // the left half is 10, the right one 200; cells of 40 x 40 pixels whose middles are on the image's edge
    let pixels: Vec<u8> = (0..64 * 64).map(|at| if at % 64 < 32 { 10 } else { 200 }).collect();
    let view = image(&pixels, 64, 64, 1);
    let lut = Lut::from_maps(&[2.0, 61.0, 2.0, 61.0], &[2.0, 2.0, 61.0, 61.0], 2, (64, 64)).unwrap();
    let options = WarpOptions { border_value: vec![99], ..area() };
    let got = lut.warp(&view, &options).unwrap();
    assert!(got.iter().zip([10, 200, 10, 200]).all(|(&got, expected)| u8::abs_diff(got, expected) <= 25), "{got:?}");
    assert!(!got.contains(&99));
}

#[test]
fn threads_strides_and_repetition_change_nothing() {
    let data = textured(SIZE.0 * SIZE.1 * 3);
    let view = image(&data, SIZE.0, SIZE.1, 3);
    let lut = coarse();
    let expected = lut.warp(&view, &WarpOptions { threads: Some(1), ..area() }).unwrap();
    for threads in [2, 3, 8] {
        assert_eq!(lut.warp(&view, &WarpOptions { threads: Some(threads), ..area() }).unwrap(), expected);
        assert_eq!(coarse().warp(&view, &WarpOptions { threads: Some(threads), ..area() }).unwrap(), expected);
    }
    let (fresh, expected) = (&coarse(), &expected);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(move || assert_eq!(&fresh.warp(&view, &area()).unwrap(), expected));
        }
    });
}

#[test]
fn views_above_each_other_do_not_share_footprints() {
    let (rows, columns) = (64, 64);
    let data = textured(SIZE.0 * SIZE.1);
    let view = image(&data, SIZE.0, SIZE.1, 1);
    // one is upright, the other turned by a quarter and of other cells; where they meet one of them is told
    let at = |upright: bool, row: usize, column: usize| {
        let (row, column) = (row as f64, column as f64);
        if upright { (20.0 + 5.0 * column, 10.0 + 3.0 * row) } else { (500.0 - 7.0 * row, 20.0 + 3.0 * column) }
    };
    let lut = |upright_at: &dyn Fn(usize) -> Option<bool>| {
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let told = |(row, column)| upright_at(row).map_or((f64::NAN, f64::NAN), |upright| at(upright, row, column));
        let (xs, ys): (Vec<_>, Vec<_>) = cells.map(told).unzip();
        Lut::from_maps(&xs, &ys, columns, (512, 256)).unwrap().warp(&view, &area()).unwrap()
    };
    for seam in 1..rows {
        let both = lut(&|row| Some(row < seam));
        let alone = [lut(&|row| (row < seam).then_some(true)), lut(&|row| (row >= seam).then_some(false))];
        // of the blocks that the seam goes through, which are four rows high, one has the footprints of the other
        let clear = |row: usize| row / 4 != seam / 4;
        for (row, cells) in both.chunks(columns).enumerate().filter(|&(row, _)| clear(row)) {
            let alone = &alone[usize::from(row >= seam)][row * columns..][..columns];
            let off = cells.iter().zip(alone).map(|(&one, &other)| one.abs_diff(other)).max();
            assert!(off <= Some(2), "row {row}, seam {seam}: {off:?}");
        }
    }
}

#[test]
fn images_before_leave_no_trace() {
    // their levels are made in the memory of those before, and where no probe looks they are not made at all
    fn check<T: ipm_rs::Bilinear + PartialEq>(image: &[T], others: [&[T]; 2]) {
        let view = |pixels| ImageView::<T>::new(pixels, SIZE, 3).unwrap();
        let lut = coarse();
        let expected = lut.warp(&view(image), &area()).unwrap();
        for other in others {
            lut.warp(&view(other), &area()).unwrap();
            assert!(lut.warp(&view(image), &area()).unwrap() == expected);
            coarse().warp(&view(other), &area()).unwrap();
            assert!(coarse().warp(&view(image), &area()).unwrap() == expected);
        }
    }
    let data = textured(SIZE.0 * SIZE.1 * 3);
    check::<u8>(&data, [&vec![0; data.len()], &vec![255; data.len()]]);
    let real: Vec<f32> = data.iter().map(|&value| f32::from(value)).collect();
    check::<f32>(&real, [&vec![f32::NAN; data.len()], &vec![f32::INFINITY; data.len()]]);
    check::<u8>(&data, [&vec![255; data.len()], &vec![0; data.len()]]);
}

#[test]
fn a_plan_is_no_part_of_what_a_table_is_but_of_its_size() {
    let (one, other) = (coarse(), coarse());
    let before = one.nbytes();
    one.warp(&image(&vec![0; SIZE.0 * SIZE.1], SIZE.0, SIZE.1, 1), &area()).unwrap();
    assert!(one.nbytes() > before && other.nbytes() == before);
    assert!(one == other && one.to_bytes().unwrap() == other.to_bytes().unwrap());
}

#[test]
fn sides_of_a_million_pixels_are_refused() {
    let wide = Lut::from_maps(&[0.0], &[0.0], 1, (1 << 20, 2)).unwrap();
    assert!(matches!(wide.sampling_density(), Err(Error::Lut(LutError::AreaSize { .. }))));
    let pixels = vec![0u8; 2 << 20];
    let got = wide.warp(&ImageView::new(&pixels, (1 << 20, 2), 1).unwrap(), &area());
    assert!(matches!(got, Err(Error::Lut(LutError::AreaSize { .. }))));
}

#[test]
fn density_is_the_length_of_the_sides() {
    let lut = affine(20, 30, [40.0, 30.0], [3.0, 4.0], [-1.5, 2.0], (512, 256));
    let density = lut.sampling_density().unwrap();
    assert!(density.as_chunks::<2>().0.iter().all(|cell| (cell[0] - 2.5).abs() < 0.01 && (cell[1] - 5.0).abs() < 0.01));
    // singular values 5.06 and 2.37
    assert!(lut.resolved_mask(2.36).unwrap().iter().all(|&seen| seen));
    assert!(!lut.resolved_mask(2.38).unwrap().iter().any(|&seen| seen));
}

#[test]
fn mode_is_the_majority_and_the_smallest_of_equals() {
    let mut labels = vec![7i32; 64 * 64];
    // cells of 8 x 8: the one at (1, 1) has 33 of id -4, the one at (2, 2) 32 of 3 and 32 of 7
    let mut set = |cell: (usize, usize), count: usize, id: i32| {
        (0..count).for_each(|at| labels[(cell.1 * 8 + at / 8) * 64 + cell.0 * 8 + at % 8] = id);
    };
    set((1, 1), 33, -4);
    set((2, 2), 32, 3);
    set((3, 3), 31, 900);
    let lut = affine(8, 8, [3.5, 3.5], [8.0, 0.0], [0.0, 8.0], (64, 64));
    let view = ImageView::new(&labels, (64, 64), 1).unwrap();
    let mut got = vec![0; 64];
    let mut out = ImageViewMut::new(&mut got, (8, 8), 1).unwrap();
    lut.warp_many_mode_into(&[view], std::slice::from_mut(&mut out), &WarpOptions::default()).unwrap();
    let mut expected = vec![7; 64];
    (expected[9], expected[18]) = (-4, 3);
    assert_eq!(got, expected);

    let many: Vec<i32> = (0..64 * 64).map(|at| at % 257).collect();
    let view = ImageView::new(&many, (64, 64), 1).unwrap();
    let mut out = ImageViewMut::new(&mut got, (8, 8), 1).unwrap();
    let refused = lut.warp_many_mode_into(&[view], std::slice::from_mut(&mut out), &WarpOptions::default());
    assert_eq!(refused, Err(Error::Warp(WarpError::TooManyIds { limit: 256 })));
}

#[test]
fn maps_that_jump_are_no_danger_and_every_instruction_set_agrees() {
    let mut state = 12345u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    let (rows, columns) = (23, 61);
    for (width, height) in [(97, 53), (3, 700), (4000, 5), (1_000_000, 3)] {
        let size = (width as usize, height as usize);
        let (w, h) = (f64::from(width), f64::from(height));
        for kind in 0..5 {
            let (mut xs, mut ys) = (vec![], vec![]);
            for row in 0..rows {
                for column in 0..columns {
                    let (across, down) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
                    let (x, y) = match kind {
                        0 => (random(), random()),                                                  // noise
                        1 => ((across * 4.0) % 1.0, (down * 3.0) % 1.0), // views side by side
                        2 => (if random() < 0.3 { f64::NAN } else { across }, down), // holes
                        3 => ((across - 0.5).abs() * 2.0, down * down),  // folded
                        _ => (across * across * 1.3 - 0.1, (down - 0.4) * 1.5 + across * random()), // beyond the edges
                    };
                    xs.push(x * (w - 1.0));
                    ys.push(y * (h - 1.0));
                }
            }
            let lut = Lut::from_maps(&xs, &ys, columns as usize, (width, height)).unwrap();
            let (constant, texture) = (vec![77u8; size.0 * size.1 * 3], textured(size.0 * size.1 * 3));
            let mut expected = None;
            for &isa in ipm_rs::Isa::available() {
                let options = WarpOptions { isa: Some(isa), border_value: vec![77], ..area() };
                let got = lut.warp(&ImageView::new(&constant, size, 3).unwrap(), &options).unwrap();
                assert!(got.iter().all(|&value| value == 77), "{width} x {height}, kind {kind}, {isa:?}");
                let got = lut.warp(&ImageView::new(&texture, size, 3).unwrap(), &options).unwrap();
                assert_eq!(&got, expected.get_or_insert(got.clone()), "{width} x {height}, kind {kind}, {isa:?}");
            }
        }
    }
}
