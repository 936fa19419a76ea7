//! The row engine: every kind of sample, layout and walk, on every instruction set against scalar, between forbidden pages.

use std::cell::RefCell;

use ipm_rs::{F16, Interpolation, Isa, Lut};

use crate::fenced::{Fenced, Guard};
use crate::input::Input;
use crate::isas::{Job, Number, Random, Rows, Walk, compared, noise};

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    match input.byte() % 12 {
        0 => all::<u8>(&mut input),
        1 => all::<u16>(&mut input),
        2 => all::<i8>(&mut input),
        3 => all::<i16>(&mut input),
        4 => all::<F16>(&mut input),
        5 => all::<f32>(&mut input),
        6 => all::<f64>(&mut input),
        7 => one::<u32>(&mut input, &Job::nearest()),
        8 => one::<u64>(&mut input, &Job::nearest()),
        _ => all::<u8>(&mut input),
    }
}

fn all<T: ipm_rs::Bilinear + Number>(input: &mut Input<'_>) {
    let wide = |interpolation| Job { warp: Lut::warp_into, interpolation };
    let job = match input.byte() % 6 {
        0 => Job::nearest(),
        1 => Job::bilinear(),
        2 => Job::area(),
        3 => Job::direct(),
        4 => wide(Interpolation::Cubic),
        _ => wide(Interpolation::Lanczos4),
    };
    one::<T>(input, &job);
}

fn one<T: Number>(input: &mut Input<'_>, job: &Job<T>) {
    thread_local! {
        static PAGES: RefCell<[Fenced; 2]> = RefCell::new([Fenced::new(1 << 20), Fenced::new(1 << 18)]);
    }
    let size = (input.count(2, 80), input.count(2, 12));
    let (channels, cells) = (input.count(1, 9), input.count(1, 150));
    let rows = match input.byte() % 5 {
        0 => Rows::Padded(input.count(0, 40)),
        1 => Rows::Backwards(input.count(0, 40)),
        2 => Rows::Repeated,
        _ => Rows::Contiguous,
    };
    let step = input.tame(8.0).abs();
    let walk = match input.byte() % 8 {
        0 => Walk::FromStart(step),
        1 => Walk::ToEnd(step),
        2 => Walk::Mirrored(step),
        3 => Walk::Down,
        4 => Walk::Random,
        5 => Walk::Jumps(input.count(1, 9)),
        6 => Walk::Ends,
        _ => Walk::Borders,
    };
    let guard = |input: &mut Input<'_>| if input.flag() { Guard::Before } else { Guard::After };
    let (at_source, at_out) = (guard(input), guard(input));
    let mut random = Random::new(input.bits());
    let data: Vec<T> = noise(rows.layout(size, channels).2, &mut random);
    let border: Vec<T> = noise(channels, &mut random);
    let lut = walk.lut(size, 1, cells, &mut random);
    let mut expected = vec![T::default(); cells * channels];
    job.run(Isa::Scalar, &lut, &rows.view(&data, size, channels), &border, &mut expected);
    PAGES.with_borrow_mut(|[source, out]| {
        for isa in compared().chain([Isa::Scalar]) {
            let room = source.samples::<T>(data.len(), at_source);
            room.copy_from_slice(&data);
            let out = out.samples::<T>(cells * channels, at_out);
            job.run(isa, &lut, &rows.view(room, size, channels), &border, out);
            let differs = out.iter().zip(&expected).position(|(&got, &expected)| !got.same(expected));
            assert!(
                differs.is_none(),
                "{}, {:?} x{channels}, {size:?}, {rows:?}, {walk:?}: sample {differs:?} of {cells} cells",
                isa.name(),
                job.interpolation
            );
        }
    });
}
