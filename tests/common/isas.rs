//! The one runner that holds every instruction set to the scalar kernels, and the jobs it is given: tables, layouts and
//! samples in all the shapes in which a kernel can go wrong.

#![allow(dead_code, reason = "each test uses its part")]

use std::fmt::{Debug, Display};
use std::io::Write;

use ipm_rs::{F16, ImageView, ImageViewMut, Interpolation, Isa, Lut, Mapping, Sample, WarpOptions, warp_direct_into};

/// Every instruction set that the library knows, whether or not this build and this CPU have it.
const KNOWN: [Isa; 4] = [Isa::Scalar, Isa::Avx2, Isa::Avx512, Isa::Neon];

/// Those to compare with scalar. What this CPU lacks is said to be not run, past the capture of passing tests.
pub(crate) fn compared() -> impl Iterator<Item = Isa> {
    static REPORT: std::sync::Once = std::sync::Once::new();
    REPORT.call_once(|| {
        let names = |available: bool| {
            let among = KNOWN.iter().filter(|isa| Isa::available().contains(isa) == available);
            among.map(|isa| isa.name()).collect::<Vec<_>>().join(" ")
        };
        // one write, so that lines of tests on other threads do not fall between
        let line = format!("instruction sets: run: {}; not run: {}\n", names(true), names(false));
        std::io::stderr().write_all(line.as_bytes()).expect("stderr is open");
    });
    Isa::available().iter().copied().filter(|&isa| isa != Isa::Scalar)
}

/// xorshift64*: the same numbers every time.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// From 0 to 1, without 1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A sample that can be made up and compared.
pub(crate) trait Number: Sample + Debug {
    fn noise(random: &mut Random) -> Self;

    /// Equal to the last bit; two NaN are equal, because their payload is not promised.
    fn same(self, other: Self) -> bool;
}

macro_rules! whole_numbers {
    ($($number:ty),*) => {$(
        impl Number for $number {
            fn noise(random: &mut Random) -> Self {
                // the high bits are the better ones, and extremes are worth more than their share
                match random.bits() >> 32 {
                    bits if bits % 16 == 0 => <$number>::MAX,
                    bits if bits % 16 == 1 => <$number>::MIN,
                    _ => (random.bits() >> (64 - <$number>::BITS)) as $number,
                }
            }

            fn same(self, other: Self) -> bool {
                self == other
            }
        }
    )*};
}
whole_numbers!(u8, u16, u32, u64, i8, i16);

macro_rules! floats {
    ($($float:ty),*) => {$(
        impl Number for $float {
            /// Mostly numbers of an image; one in a hundred is something that arithmetic rarely meets.
            fn noise(random: &mut Random) -> Self {
                const WILD: [$float; 9] = [
                    <$float>::NAN,
                    <$float>::INFINITY,
                    <$float>::NEG_INFINITY,
                    <$float>::MAX,
                    <$float>::MIN,
                    <$float>::MIN_POSITIVE,
                    1e-45,
                    -0.0,
                    -3e38,
                ];
                match random.bits() >> 32 {
                    bits if bits % 100 == 0 => WILD[(bits / 100) as usize % WILD.len()],
                    bits if bits % 100 < 10 => (bits / 100 % 256) as $float,
                    _ => ((random.unit() - 0.3) * 1e4) as $float,
                }
            }

            fn same(self, other: Self) -> bool {
                self.to_bits() == other.to_bits() || (self.is_nan() && other.is_nan())
            }
        }
    )*};
}
floats!(f32, f64);

impl Number for F16 {
    /// Numbers of an image, and one in ten any half at all: subnormal, infinite, NaN.
    fn noise(random: &mut Random) -> Self {
        match random.bits() >> 32 {
            bits if bits % 10 == 0 => Self::from_bits((bits / 10) as u16),
            _ => Self::from_f32(f32::noise(random)),
        }
    }

    fn same(self, other: Self) -> bool {
        self.to_bits() == other.to_bits() || (self.to_f32().is_nan() && other.to_f32().is_nan())
    }
}

/// How the rows of a source lie in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rows {
    /// Back to back.
    Contiguous,
    /// With so many samples between them.
    Padded(usize),
    /// With so many samples between them, the last row first.
    Backwards(usize),
    /// All the same one: stride 0.
    Repeated,
}

impl Rows {
    pub(crate) const ALL: [Self; 5] =
        [Self::Contiguous, Self::Padded(1), Self::Padded(67), Self::Backwards(5), Self::Repeated];

    /// (index of row 0, row stride, samples from the first to the last that belong to a row).
    pub(crate) fn layout(self, (width, height): (usize, usize), channels: usize) -> (usize, isize, usize) {
        let row = width * channels;
        let spread = |stride: usize| (height - 1) * stride + row;
        match self {
            Self::Contiguous => (0, row as isize, height * row),
            Self::Padded(gap) => (0, (row + gap) as isize, spread(row + gap)),
            Self::Backwards(gap) => ((height - 1) * (row + gap), -((row + gap) as isize), spread(row + gap)),
            Self::Repeated => (0, 0, row),
        }
    }

    /// A view of exactly those samples.
    pub(crate) fn view<T>(self, data: &[T], size: (usize, usize), channels: usize) -> ImageView<'_, T> {
        let (origin, stride, samples) = self.layout(size, channels);
        ImageView::with_row_stride(&data[..samples], size, channels, origin, stride).expect("the layout fits")
    }
}

/// Where the cells of an output row look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Walk {
    /// From the first pixel on, so many pixels a cell, on into the next row.
    FromStart(f64),
    /// The same, up to the last pixel.
    ToEnd(f64),
    /// From the last pixel back: a mirrored view, whose offsets decrease.
    Mirrored(f64),
    /// Down a column.
    Down,
    /// Anywhere.
    Random,
    /// Along two rows, so many cells in each at a time.
    Jumps(usize),
    /// The first and the last pixel that a cell can have, in turn.
    Ends,
    /// Anywhere inside, on the rim, in the halo, outside, and nowhere.
    Borders,
}

impl Walk {
    /// In the seed grid neighbouring cells are 1.2 to 10.6 pixels apart.
    pub(crate) const ALL: [Self; 14] = [
        Self::FromStart(0.0),
        Self::FromStart(0.31),
        Self::FromStart(1.2),
        Self::FromStart(4.7),
        Self::ToEnd(0.9),
        Self::ToEnd(2.3),
        Self::Mirrored(0.31),
        Self::Mirrored(1.0),
        Self::Mirrored(5.3),
        Self::Down,
        Self::Random,
        Self::Jumps(3),
        Self::Ends,
        Self::Borders,
    ];

    /// A table of `rows` output rows of so many cells. A source of less than 2 x 2 pixels has no inside to walk on.
    pub(crate) fn lut(self, (width, height): (usize, usize), rows: usize, cells: usize, random: &mut Random) -> Lut {
        assert!(width >= 2 && height >= 2);
        // pixels that can be the top left of four
        let (columns, lines) = (width - 1, height - 1);
        let along = |pixels: f64, random: &mut Random| {
            let whole = (pixels as usize) % (columns * lines);
            // fractions that stay inside after rounding to Q15, halves among them
            let fraction = |random: &mut Random| match random.bits() >> 60 {
                0 => 0.0,
                1 => 0.5,
                2 => 0.9999,
                _ => random.unit() * 0.9999,
            };
            let (x, y) = (whole % columns, whole / columns);
            [x as f64 + fraction(random), y as f64 + fraction(random)]
        };
        let last = (columns * lines) as f64 - 1.0;
        let mut coordinates = Vec::with_capacity(rows * cells);
        for row in 0..rows {
            for cell in 0..cells {
                let (at, left) = ((row * 7 + cell) as f64, (cells - 1 - cell) as f64);
                coordinates.push(match self {
                    Self::FromStart(step) => along(at * step, random),
                    Self::ToEnd(step) => along((last - left * step).max(0.0), random),
                    Self::Mirrored(step) => along((last - at * step).max(0.0), random),
                    Self::Down => along(((row * 7 + cell) * columns + row) as f64, random),
                    Self::Random => along(random.unit() * last, random),
                    Self::Jumps(length) => along((cell / length % 2 * columns) as f64 + at * 0.6, random),
                    Self::Ends => along(if random.bits() >> 63 == 0 { 0.0 } else { last }, random),
                    Self::Borders => match random.bits() >> 60 {
                        0 => [f64::NAN, 1.0],
                        1 => [-1.5, 0.5],
                        2 => [random.unit() - 1.0, random.unit() * lines as f64],
                        3 => [columns as f64 + random.unit(), lines as f64],
                        4 => [columns as f64, random.unit() * lines as f64],
                        5 => [random.unit() * columns as f64, lines as f64],
                        // runs of several cells too
                        _ => along(at * 1.2, random),
                    },
                });
            }
        }
        let (map_x, map_y): (Vec<f64>, Vec<f64>) = coordinates.into_iter().map(|[u, v]| (u, v)).unzip();
        Lut::from_maps(&map_x, &map_y, cells, (width as u32, height as u32)).expect("the maps fit")
    }
}

/// One of `Lut::warp_into` and `Lut::warp_nearest_into`.
pub(crate) type Warp<T> = fn(&Lut, &ImageView<'_, T>, &mut ImageViewMut<'_, T>, &WarpOptions<T>) -> ipm_rs::Result<()>;

/// What is done with a picture.
pub(crate) struct Job<T> {
    pub(crate) warp: Warp<T>,
    pub(crate) interpolation: Interpolation,
}

impl<T: ipm_rs::Bilinear> Job<T> {
    pub(crate) fn bilinear() -> Self {
        Self { warp: Lut::warp_into, interpolation: Interpolation::Bilinear }
    }

    pub(crate) fn area() -> Self {
        Self { warp: Lut::warp_into, interpolation: Interpolation::Area }
    }

    /// Bilinear without a table, by the maps of one.
    pub(crate) fn direct() -> Self {
        let warp: Warp<T> = |lut, view, out, options| {
            let (map_x, map_y) = lut.maps(f32::NAN).expect("memory for the maps");
            warp_direct_into(view, &Mapping::MapsF32(&map_x, &map_y), out, options)
        };
        Self { warp, interpolation: Interpolation::Bilinear }
    }
}

impl<T: Sample> Job<T> {
    pub(crate) fn nearest() -> Self {
        Self { warp: Lut::warp_nearest_into, interpolation: Interpolation::Nearest }
    }
}

impl<T: Number> Job<T> {
    /// Warps into `out`, which holds the cells back to back.
    pub(crate) fn run(&self, isa: Isa, lut: &Lut, view: &ImageView<'_, T>, border: &[T], out: &mut [T]) {
        let size = (lut.columns(), lut.rows());
        let mut out = ImageViewMut::new(out, size, view.channels()).expect("the output fits the table");
        (self.warp)(lut, view, &mut out, &self.options(isa, border)).expect("the image fits the table");
    }

    /// Warps with every instruction set, rows apart from each other: all cells are as scalar has them, and nothing
    /// between them is touched. Names the first difference.
    pub(crate) fn compare(&self, lut: &Lut, view: &ImageView<'_, T>, border: &[T], what: &dyn Display) {
        const GAP: usize = 5;
        let channels = view.channels();
        let row = lut.columns() * channels;
        let untouched = vec![border[0]; lut.rows() * (row + GAP) + GAP];
        let warp = |isa| {
            let mut canvas = untouched.clone();
            let (size, stride) = ((lut.columns(), lut.rows()), (row + GAP) as isize);
            let mut out =
                ImageViewMut::with_row_stride(&mut canvas, size, channels, GAP, stride).expect("the rows fit");
            (self.warp)(lut, view, &mut out, &self.options(isa, border)).expect("the image fits the table");
            canvas
        };
        let expected = warp(Isa::Scalar);
        for isa in compared() {
            let got = warp(isa);
            let differs = (0..got.len()).find(|&at| !got[at].same(expected[at]));
            if let Some(at) = differs {
                let (line, sample) = ((at.max(GAP) - GAP) / (row + GAP), (at.max(GAP) - GAP) % (row + GAP));
                panic!(
                    "{}, {:?} of {} x{channels}, {what}: row {line}, cell {} of {}, channel {}: {:?}, scalar {:?}",
                    isa.name(),
                    self.interpolation,
                    std::any::type_name::<T>(),
                    sample / channels,
                    lut.columns(),
                    sample % channels,
                    got[at],
                    expected[at],
                );
            }
        }
    }

    fn options(&self, isa: Isa, border: &[T]) -> WarpOptions<T> {
        WarpOptions {
            border_mode: None,
            interpolation: self.interpolation,
            border_value: border.to_vec(),
            isa: Some(isa),
            threads: Some(1),
        }
    }
}

/// So many made-up samples.
pub(crate) fn noise<T: Number>(samples: usize, random: &mut Random) -> Vec<T> {
    (0..samples).map(|_| T::noise(random)).collect()
}
