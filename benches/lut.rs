//! Building tables: `cargo bench --bench lut`. Throughput in cells.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{seed_camera, seed_grid};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ipm_rs::{Ground, Lut};

fn build(criterion: &mut Criterion) {
    let (camera, grid, ground) = (seed_camera(), seed_grid((0.05, 0.025)), Ground::default());
    let lut = Lut::new(&camera, &grid, &ground).expect("the seed job fits");
    let (map_x, map_y) = lut.maps(f32::NAN);
    let source = lut.source_size();

    let mut group = criterion.benchmark_group("lut");
    group.throughput(Throughput::Elements((grid.rows() * grid.columns()) as u64));
    group.bench_function("pinhole", |bencher| bencher.iter(|| Lut::new(&camera, &grid, &ground)));
    group.bench_function("from_maps/f32", |bencher| {
        bencher.iter(|| Lut::from_maps(&map_x, &map_y, grid.columns(), source));
    });
    group.bench_function("maps", |bencher| bencher.iter(|| lut.maps(f32::NAN)));
    group.bench_function("to_bytes and back", |bencher| bencher.iter(|| Lut::from_bytes(&lut.to_bytes())));
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
