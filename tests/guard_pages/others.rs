//! What is public beyond warps through tables: the same fences around it.

use ipm_rs::cloud::{
    ChannelOrder, DepthOptions, DepthUnit, Projections, decode_carla_depth_into, encode_carla_depth_into,
    points_from_depth_into, project_into,
};
use ipm_rs::mosaic::{Frame, Kept, Layers, Tile};
use ipm_rs::raster::{RasterOptions, Reduce, rasterize};
use ipm_rs::view::Strided;
use ipm_rs::{
    BevGrid, Bilinear, BorderMode, BrownConrady, Camera, Ground, ImageView, ImageViewMut, Interpolation, KannalaBrandt,
    Lens, Lut, Pinhole, Sample, SampleAt, WarpOptions,
};

use super::fenced::{Fenced, GUARDS, Guard};
use super::isas::{Number, Random, compared, noise};
use super::{Pages, trying};

/// So many places in the image, at its edges and beyond.
fn scattered((width, height): (usize, usize), cells: usize, random: &mut Random) -> (Vec<f64>, Vec<f64>) {
    let mut place = |size: usize| (random.unit() * 1.8 - 0.4) * size as f64;
    (0..cells).map(|_| (place(width), place(height))).unzip()
}

/// An output of one row or of several, in a buffer.
fn view<T>(data: &mut [T], size: (usize, usize), channels: usize) -> ImageViewMut<'_, T> {
    ImageViewMut::new(data, size, channels).expect("the buffer fits")
}

/// Tables of every border mode, whose source begins again or not, through every interpolation.
pub(super) fn borders<T: Bilinear + Number>(
    pages: &mut Pages,
    size: (usize, usize),
    channels: usize,
    random: &mut Random,
) {
    let data: Vec<T> = noise(size.0 * size.1 * channels, random);
    for mode in BorderMode::ALL.into_iter().filter(|mode| *mode != BorderMode::Transparent) {
        for wraps in [false, true] {
            let cells = 1 + (random.bits() >> 32) as usize % 40;
            let (x, y) = scattered(size, cells, random);
            let source_size = (size.0 as u32, size.1 as u32);
            let lut = Lut::from_maps_with(&x, &y, cells, source_size, mode, wraps).expect("any maps do");
            for interpolation in Interpolation::ALL {
                for isa in compared().chain([ipm_rs::Isa::Scalar]) {
                    for (source_guard, out_guard) in [GUARDS[0], GUARDS[3]] {
                        let source = pages.source.samples::<T>(data.len(), source_guard);
                        source.copy_from_slice(&data);
                        let image = ImageView::new(source, size, channels).expect("an image");
                        let out = pages.out.samples::<T>(cells * channels, out_guard);
                        let options =
                            WarpOptions { interpolation, isa: Some(isa), threads: Some(1), ..WarpOptions::default() };
                        let what = format!("{isa:?}, {interpolation:?}, {mode:?}, wraps {wraps}, {size:?} x{channels}");
                        trying(&what, || lut.warp_into(&image, &mut view(out, (cells, 1), channels), &options))
                            .expect("the image fits the table");
                    }
                }
            }
        }
    }
}

/// Gradients back to the image.
pub(super) fn adjoints(pages: &mut Pages, size: (usize, usize), random: &mut Random) {
    let cells = 1 + (random.bits() >> 32) as usize % 40;
    let (x, y) = scattered(size, cells, random);
    let lut = Lut::from_maps(&x, &y, cells, (size.0 as u32, size.1 as u32)).expect("any maps do");
    for interpolation in [Interpolation::Nearest, Interpolation::Bilinear, Interpolation::Area] {
        for channels in [1, 2, 3, 5] {
            for (source_guard, out_guard) in GUARDS {
                let source = pages.source.samples::<f32>(cells * channels, source_guard);
                source.fill(1.5);
                let grad = ImageView::new(source, (cells, 1), channels).expect("a gradient");
                let out = pages.out.samples::<f32>(size.0 * size.1 * channels, out_guard);
                let options = WarpOptions { interpolation, threads: Some(1), ..WarpOptions::default() };
                trying(&format!("adjoint of {interpolation:?} x{channels}, {size:?}"), || {
                    lut.warp_adjoint_into(&grad, &mut view(out, size, channels), &options)
                })
                .expect("the gradient fits the table");
            }
        }
    }
}

/// The most frequent label.
pub(super) fn labels(pages: &mut Pages, size: (usize, usize), random: &mut Random) {
    let cells = 1 + (random.bits() >> 32) as usize % 40;
    let (x, y) = scattered(size, cells, random);
    let lut = Lut::from_maps(&x, &y, cells, (size.0 as u32, size.1 as u32)).expect("any maps do");
    for (source_guard, out_guard) in GUARDS {
        let source = pages.source.samples::<u16>(size.0 * size.1, source_guard);
        let images = [ImageView::new(source, size, 1).expect("labels")];
        let mut outs = [view(pages.out.samples::<u16>(cells, out_guard), (cells, 1), 1)];
        let options = WarpOptions { threads: Some(1), ..WarpOptions::default() };
        trying("mode", || lut.warp_many_mode_into(&images, &mut outs, &options)).expect("the image fits the table");
    }
}

fn cameras(size: (u32, u32)) -> Vec<Camera> {
    let model = Pinhole::new(16.0, 16.5, 19.7, 14.2, 0.0).expect("a pinhole");
    let camera = Camera::from_euler(model, size, [0.0, 0.0, 1.5], 0.0, 0.6, 0.1).expect("a camera");
    let brown: Lens = BrownConrady::new(&[-0.1, 0.01, 1e-3, 1e-3, 0.0], None).expect("a lens").into();
    let fisheye: Lens = KannalaBrandt::new(&[0.02, -0.01, 0.0, 0.0], None).expect("a lens").into();
    [None, Some(brown), Some(fisheye)].into_iter().map(|lens| camera.with_lens(lens)).collect()
}

/// Depth to codes and back, to points, and points to pixels.
pub(super) fn clouds(pages: &mut Pages, random: &mut Random) {
    for size in [(1, 1), (3, 2), (17, 3), (33, 5)] {
        let (pixels, threads) = (size.0 * size.1, Some(1));
        for (source_guard, out_guard) in GUARDS {
            for order in ChannelOrder::ALL {
                let codes: Vec<u8> = noise(pixels * order.channels(), random);
                let source = pages.source.samples::<u8>(codes.len(), source_guard);
                source.copy_from_slice(&codes);
                let image = ImageView::new(source, size, order.channels()).expect("an image");
                let out = pages.out.samples::<f32>(pixels, out_guard);
                let unit = DepthUnit::Metres;
                trying("decode", || decode_carla_depth_into(&image, order, unit, &mut view(out, size, 1), threads))
                    .expect("it fits");
                let depth = pages.source.samples::<f32>(pixels, source_guard);
                let depth = ImageView::new(depth, size, 1).expect("an image");
                let out = pages.out.samples::<u8>(pixels * order.channels(), out_guard);
                let mut out = view(out, size, order.channels());
                trying("encode", || encode_carla_depth_into(&depth, order, unit, &mut out, threads)).expect("it fits");
            }
            for camera in cameras((size.0 as u32, size.1 as u32)) {
                let depth = pages.source.samples::<f32>(pixels, source_guard);
                depth.fill(3.0);
                let depth = ImageView::new(depth, size, 1).expect("an image");
                let mut out = view(pages.out.samples::<f32>(3 * pixels, out_guard), size, 3);
                let (pose, options) = (*camera.vehicle_from_camera(), DepthOptions { threads, ..Default::default() });
                trying("points of depth", || points_from_depth_into(&depth, &camera, &pose, None, &options, &mut out))
                    .expect("it fits");
                for columns in [3, 4, 5] {
                    let points: Vec<f32> = noise(pixels * columns, random);
                    let source = pages.source.samples::<f32>(points.len(), source_guard);
                    source.copy_from_slice(&points);
                    let points = Strided::new(source, columns).expect("whole rows");
                    let uv = pages.out.samples::<f64>(2 * pixels, out_guard).as_chunks_mut().0;
                    let (mut depth, mut valid) = (vec![0.0; pixels], vec![false; pixels]);
                    let out = Projections { uv, depth: &mut depth, valid: &mut valid };
                    trying("projection", || project_into(&camera, &points, out, threads)).expect("it fits");
                }
            }
        }
    }
}

/// Points onto a grid.
pub(super) fn rasters(pages: &mut Pages, random: &mut Random) {
    let grid = BevGrid::new((-9.0, 9.0), (-6.0, 6.0), (0.5, 0.25), SampleAt::Center).expect("a grid");
    for count in [0, 1, 7, 129, 1100] {
        for columns in [2, 3, 4] {
            for guard in [Guard::Before, Guard::After] {
                let room = pages.source.samples::<f32>(count * columns, guard);
                room.iter_mut().for_each(|number| *number = ((random.unit() - 0.5) * 22.0) as f32);
                let points = Strided::new(room, columns).expect("whole rows");
                let reduce: &[Reduce] = if columns == 2 { &[Reduce::Count] } else { &Reduce::ALL };
                let options = RasterOptions { reduce, threads: Some(1), ..RasterOptions::default() };
                let raster = trying("raster", || rasterize(&points, None, &grid, &options)).expect("it fits");
                assert_eq!(raster.inside + raster.outside, count);
            }
        }
    }
}

/// The accumulators of a tile, each of its layers in pages of its own.
pub(super) fn mosaics(pages: &mut Pages, random: &mut Random) {
    const SIDE: usize = 13;
    fn layer<T: Sample>(pages: &mut Fenced, count: usize, guard: Guard) -> &mut [T] {
        pages.samples::<T>(count, guard)
    }
    let (camera, ground) = (cameras((40, 30))[0], Ground::default());
    let frame = Frame {
        camera,
        mask: None,
        ground: &ground,
        from: [0.0; 2],
        distance: (0.0, f64::INFINITY),
        weight: 1.0,
        id: 7,
    };
    let mut rooms: Vec<Fenced> = (0..9).map(|_| Fenced::new(SIDE * SIDE * 5 * 8)).collect();
    for (channels, samples, labels) in [(1, 0, false), (2, 3, false), (3, 1, false), (5, 0, false), (1, 2, true)] {
        let kept = Kept { channels, samples, labels };
        let pixels: Vec<u8> = noise(40 * 30 * channels, random);
        for (source_guard, guard) in GUARDS {
            for (at, rows, columns) in [((0, 0), SIDE, SIDE), ((5, 7), SIDE - 5, SIDE - 7), ((12, 0), 1, 3)] {
                let source = pages.source.samples::<u8>(pixels.len(), source_guard);
                source.copy_from_slice(&pixels);
                let image = ImageView::new(source, (40, 30), channels).expect("an image");
                let (deep, wide) = (1.0 + rows as f64 * 0.25, columns as f64 * 0.25);
                let window = BevGrid::new((1.0, deep), (-wide / 2.0, wide / 2.0), (0.25, 0.25), SampleAt::Center);
                let [weights, totals, counts, sums, squares, resolutions, bests, keys, values] = &mut rooms[..] else {
                    unreachable!("nine rooms");
                };
                let (cells, numbers) = (SIDE * SIDE, SIDE * SIDE * channels);
                let summed = if labels { 0 } else { numbers };
                let layers = Layers {
                    weights: layer(weights, cells, guard),
                    totals: layer(totals, summed, guard),
                    counts: layer(counts, cells, guard),
                    sums: layer(sums, summed, guard),
                    squares: layer(squares, summed, guard),
                    resolutions: layer(resolutions, cells, guard),
                    bests: layer(bests, numbers, guard),
                    keys: layer(keys, cells * samples, guard),
                    samples: layer(values, numbers * samples, guard),
                };
                let tile = Tile::<u8>::new(SIDE, kept, layers).expect("all are as long as the others");
                let window = window.expect("whole cells");
                trying("mosaic", || frame.add(&image, &window, tile, at, Some(1))).expect("the window is in the tile");
            }
        }
    }
}
