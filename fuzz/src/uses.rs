//! All that can be done with a table, a part of it for each input: so that there are many inputs.

use ipm_rs::{ImageView, ImageViewMut, Interpolation, Lut, WarpOptions};

use crate::fenced::{Fenced, Guard};
use crate::input::Input;
use crate::isas::{Job, Number, Random, compared, noise};

/// Images have at most so many samples, and so have outputs.
const MOST: usize = 1 << 16;

/// Warps images of a few kinds through a table, between forbidden pages, with every instruction set; compares them, and
/// asks the table all it can be asked.
pub(crate) fn everything(lut: &Lut, input: &mut Input<'_>) {
    let (width, height) = lut.source_size();
    let (pixels, cells) = (u64::from(width) * u64::from(height), lut.rows() * lut.columns());
    if pixels > 1 << 12 || cells > 1 << 12 {
        return; // as good as any, and slow
    }
    let bytes = lut.to_bytes().expect("there is memory");
    assert!(*lut == Lut::from_bytes(&bytes).expect("a table's own bytes"), "a table is not what its bytes say");
    let (mask, (x, y)) = (lut.mask().expect("memory"), lut.maps(f32::NAN).expect("memory"));
    assert_eq!(mask.iter().filter(|valid| **valid).count(), lut.valid_cells());
    let inside = |at: f32, size: u32| at >= 0.0 && at <= size as f32;
    for (cell, _) in mask.iter().enumerate().filter(|(_, valid)| **valid) {
        assert!(inside(x[cell], width) && inside(y[cell], height), "a valid cell samples at {} {}", x[cell], y[cell]);
    }
    lut.sampling_density().expect("memory");
    let channels = input.count(1, 5);
    let mut random = Random::new(input.bits());
    let size = (width as usize, height as usize);
    match input.count(0, 5) {
        0 => warps::<u16>(lut, size, channels, &mut random),
        1 => warps::<f32>(lut, size, channels, &mut random),
        2 => warps::<f64>(lut, size, channels, &mut random),
        3 => warps::<i8>(lut, size, channels, &mut random),
        _ => warps::<u8>(lut, size, channels, &mut random),
    }
}

fn warps<T: ipm_rs::Bilinear + Number>(lut: &Lut, size: (usize, usize), channels: usize, random: &mut Random) {
    thread_local! {
        static PAGES: std::cell::RefCell<[Fenced; 2]> =
            std::cell::RefCell::new([Fenced::new(8 * MOST), Fenced::new(8 * MOST)]);
    }
    let (samples, cells) = (size.0 * size.1 * channels, lut.rows() * lut.columns());
    if samples > MOST || cells * channels > MOST {
        return;
    }
    let data: Vec<T> = noise(samples, random);
    let border: Vec<T> = noise(channels, random);
    let wide = |interpolation| Job { warp: Lut::warp_into, interpolation };
    let job = match random.bits() >> 32 & 7 {
        0 => Job::nearest(),
        1 => Job::area(),
        2 => wide(Interpolation::Cubic),
        3 => wide(Interpolation::Lanczos4),
        _ => Job::bilinear(),
    };
    let guard = if random.bits() >> 63 == 0 { Guard::Before } else { Guard::After };
    PAGES.with_borrow_mut(|[source, out]| {
        let mut expected = vec![T::default(); cells * channels];
        let view = ImageView::new(&data, size, channels).expect("an image");
        job.run(ipm_rs::Isa::Scalar, lut, &view, &border, &mut expected);
        for isa in compared().chain([ipm_rs::Isa::Scalar]) {
            let room = source.samples::<T>(samples, guard);
            room.copy_from_slice(&data);
            let view = ImageView::new(room, size, channels).expect("an image");
            let out = out.samples::<T>(cells * channels, guard);
            job.run(isa, lut, &view, &border, out);
            let same = out.iter().zip(&expected).all(|(&got, &expected)| got.same(expected));
            assert!(same, "{}, {:?} x{channels} differs from scalar", isa.name(), job.interpolation);
        }
    });
    if random.bits() >> 62 != 0 {
        return;
    }
    // labels: what is there most
    let labels: Vec<u8> = noise(size.0 * size.1, random);
    let views = [ImageView::new(&labels, size, 1).expect("an image")];
    let mut out = vec![0; cells];
    let mut outs = [ImageViewMut::new(&mut out, (lut.columns(), lut.rows()), 1).expect("an output")];
    lut.warp_many_mode_into(&views, &mut outs, &WarpOptions::default()).expect("the image fits the table");
}
