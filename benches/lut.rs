//! Building tables: `cargo bench --bench lut`. Throughput in cells.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{seed_camera, seed_grid, textured};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ipm_rs::{
    BrownConrady, DoubleSphere, Eucm, Ground, ImageView, ImageViewMut, Interpolation, KannalaBrandt, Lens, Lut, Mei,
    Ocam, RadialPolynomial, WarpOptions,
};

fn build(criterion: &mut Criterion) {
    let (camera, grid, ground) = (seed_camera(), seed_grid((0.05, 0.025)), Ground::default());
    let lut = Lut::new(&camera, &grid, &ground).expect("the seed job fits");
    let (map_x, map_y) = lut.maps(f32::NAN).expect("memory");
    let source = lut.source_size();

    let mut group = criterion.benchmark_group("lut");
    group.throughput(Throughput::Elements((grid.rows() * grid.columns()) as u64));
    group.bench_function("pinhole", |bencher| bencher.iter(|| Lut::new(&camera, &grid, &ground)));
    let lenses: [(&str, Lens); 7] = [
        ("brown_conrady/5", BrownConrady::new(&[-0.3, 0.12, 1e-3, -5e-4, -0.02], None).expect("five").into()),
        ("kannala_brandt", KannalaBrandt::new(&[0.02, -0.01, 0.003, -0.0005], None).expect("four").into()),
        ("mei", Mei::new(0.8, &[-0.1, 0.05, 4e-4, -5e-4], None).expect("four").into()),
        ("double_sphere", DoubleSphere::new(-0.2, 0.6, None).expect("in range").into()),
        ("eucm", Eucm::new(0.6, 1.1, None).expect("in range").into()),
        ("radial_polynomial", RadialPolynomial::new(&[0.96, -0.1, 0.1, -0.02], None).expect("four").into()),
        ("ocam", Ocam::new(&[-1.0, 0.0, 0.1, -0.01], [1.0, 0.0, 0.0], None).expect("in range").into()),
    ];
    for (name, lens) in lenses {
        let camera = camera.with_lens(lens);
        group.bench_function(name, |bencher| bencher.iter(|| Lut::new(&camera, &grid, &ground)));
    }
    group.bench_function("from_maps/f32", |bencher| {
        bencher.iter(|| Lut::from_maps(&map_x, &map_y, grid.columns(), source));
    });
    group.bench_function("maps", |bencher| bencher.iter(|| lut.maps(f32::NAN).expect("memory")));
    group.bench_function("to_bytes and back", |bencher| {
        bencher.iter(|| Lut::from_bytes(&lut.to_bytes().expect("memory")))
    });
    group.finish();
}

/// A table, and a table with the first area warp, which makes the plan; `area/10 cm` of the bench `warp` is a later one.
fn build_for_area(criterion: &mut Criterion) {
    let (camera, grid, ground) = (seed_camera(), seed_grid((0.1, 0.1)), Ground::default());
    let data = textured(2048 * 1024 * 3);
    let image = ImageView::new(&data, (2048, 1024), 3).expect("the image fits its size");
    let mut out = vec![0; grid.rows() * grid.columns() * 3];
    let options = WarpOptions { interpolation: Interpolation::Area, ..WarpOptions::default() };

    let mut group = criterion.benchmark_group("lut, 10 cm");
    group.throughput(Throughput::Elements((grid.rows() * grid.columns()) as u64));
    group.bench_function("pinhole", |bencher| bencher.iter(|| Lut::new(&camera, &grid, &ground)));
    group.bench_function("pinhole, first area warp of u8x3", |bencher| {
        bencher.iter(|| {
            let lut = Lut::new(&camera, &grid, &ground).expect("the seed job fits");
            let mut out = ImageViewMut::new(&mut out, (grid.columns(), grid.rows()), 3).expect("the output fits");
            lut.warp_into(&image, &mut out, &options).expect("the image fits the table");
            lut
        });
    });
    group.finish();
}

criterion_group!(benches, build, build_for_area);
criterion_main!(benches);
