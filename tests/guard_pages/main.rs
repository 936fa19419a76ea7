//! No kernel reads or writes a byte outside the image and the output: both lie directly after or directly before a
//! page that may not be touched, so that a single byte too many ends the process. AddressSanitizer does not see gathers
//! out of bounds; this does, and it works for every instruction set and under emulation.

#![cfg(unix)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/fenced.rs"]
mod fenced;
#[path = "../common/isas.rs"]
mod isas;
mod others;

use std::mem::MaybeUninit;
use std::ptr;
use std::sync::atomic::{AtomicPtr, Ordering};

use fenced::{Fenced, GUARDS, Guard};
use ipm_rs::rig::{Mix, RigLut, RigOptions};
use ipm_rs::{
    BevGrid, Bilinear, Camera, F16, Ground, ImageView, ImageViewMut, Interpolation, Isa, Lut, Pinhole, SampleAt,
    WarpOptions,
};
use isas::{Job, Number, Random, Rows, Walk, compared, noise};

/// What is being tried, for the last words of a process that touched a fence: a C string.
static TRYING: AtomicPtr<libc::c_char> = AtomicPtr::new(ptr::null_mut());

/// Says what was being tried, then lets the fault happen again without this handler.
extern "C" fn last_words(signal: libc::c_int) {
    let words = TRYING.load(Ordering::Relaxed);
    if !words.is_null() {
        // SAFETY: all four may be called in a signal handler, and the string outlives what it describes.
        unsafe {
            libc::write(2, words.cast(), libc::strlen(words));
            libc::signal(signal, libc::SIG_DFL);
        }
    }
}

/// Installs the handler on both signals that a forbidden page can raise.
fn announce_faults() {
    for signal in [libc::SIGSEGV, libc::SIGBUS] {
        // SAFETY: the handler has the type that these flags ask for, and all bits zero is a good `sigaction`.
        unsafe {
            let mut action: libc::sigaction = MaybeUninit::zeroed().assume_init();
            action.sa_sigaction = last_words as extern "C" fn(libc::c_int) as libc::sighandler_t;
            assert_eq!(libc::sigaction(signal, &action, ptr::null_mut()), 0);
        }
    }
}

/// Does something that would touch a fence if it were wrong, and says what if it does.
fn trying<R>(what: &str, work: impl FnOnce() -> R) -> R {
    let words = format!("\nfault: {what}\n\0");
    TRYING.store(words.as_ptr().cast_mut().cast(), Ordering::Relaxed);
    let result = work();
    TRYING.store(ptr::null_mut(), Ordering::Relaxed);
    result
}

/// The fenced pages of a source and of an output.
struct Pages {
    source: Fenced,
    out: Fenced,
}

impl Pages {
    /// Warps with every instruction set beside every fence, and compares with scalar.
    fn try_all<T: Number>(&mut self, job: &Job<T>, size: (usize, usize), channels: usize, random: &mut Random) {
        let border: Vec<T> = noise(channels, random);
        for rows in Rows::ALL {
            let data: Vec<T> = noise(rows.layout(size, channels).2, random);
            for walk in Walk::ALL {
                // tails of every length come by
                let cells = 1 + (random.bits() >> 32) as usize % 70;
                let lut = walk.lut(size, 1, cells, random);
                let mut expected = vec![T::default(); cells * channels];
                job.run(Isa::Scalar, &lut, &rows.view(&data, size, channels), &border, &mut expected);
                for isa in compared().chain([Isa::Scalar]) {
                    // every side of the source with every side of the output
                    for (source_guard, out_guard) in GUARDS {
                        let what = format!(
                            "\nfault: {}, {:?} of {} x{channels}, {size:?}, {rows:?}, {walk:?}, {cells} cells, guard \
                             {source_guard:?} the source and {out_guard:?} the output\n\0",
                            isa.name(),
                            job.interpolation,
                            std::any::type_name::<T>(),
                        );
                        let source = self.source.samples::<T>(data.len(), source_guard);
                        source.copy_from_slice(&data);
                        let view = rows.view(source, size, channels);
                        let out = self.out.samples::<T>(cells * channels, out_guard);
                        TRYING.store(what.as_ptr().cast_mut().cast(), Ordering::Relaxed);
                        job.run(isa, &lut, &view, &border, out);
                        TRYING.store(ptr::null_mut(), Ordering::Relaxed);
                        let same = out.iter().zip(&expected).all(|(&got, &expected)| got.same(expected));
                        assert!(same, "differs from scalar where a fault would say{}", what.trim_end_matches('\0'));
                    }
                }
            }
        }
    }

    fn bilinear<T: Bilinear + Number>(&mut self, size: (usize, usize), channels: usize, random: &mut Random) {
        self.try_all(&Job::<T>::bilinear(), size, channels, random);
    }

    /// Several images of one channel, the first at one fence and the last at the other.
    fn planes<T: Bilinear + Number>(&mut self, size: (usize, usize), random: &mut Random) {
        const COUNT: usize = 5;
        let data: Vec<T> = noise(size.0 * size.1 * COUNT, random);
        for walk in Walk::ALL {
            let cells = 1 + (random.bits() >> 32) as usize % 70;
            let lut = walk.lut(size, 1, cells, random);
            for isa in compared().chain([Isa::Scalar]) {
                for (source_guard, out_guard) in GUARDS {
                    let what = format!(
                        "\nfault: {}, {COUNT} planes of {}, {size:?}, {walk:?}, {cells} cells, guard {source_guard:?} the \
                         sources and {out_guard:?} the outputs\n\0",
                        isa.name(),
                        std::any::type_name::<T>(),
                    );
                    let source = self.source.samples::<T>(data.len(), source_guard);
                    source.copy_from_slice(&data);
                    let views: Vec<_> = source
                        .chunks(size.0 * size.1)
                        .map(|plane| ImageView::new(plane, size, 1).expect("a plane"))
                        .collect();
                    let mut outs: Vec<_> = self
                        .out
                        .samples::<T>(cells * COUNT, out_guard)
                        .chunks_mut(cells)
                        .map(|plane| ImageViewMut::new(plane, (cells, 1), 1).expect("a row"))
                        .collect();
                    let options = WarpOptions { isa: Some(isa), threads: Some(1), ..WarpOptions::default() };
                    TRYING.store(what.as_ptr().cast_mut().cast(), Ordering::Relaxed);
                    lut.warp_many_into(&views, &mut outs, &options).expect("the planes fit the table");
                    TRYING.store(ptr::null_mut(), Ordering::Relaxed);
                }
            }
        }
    }

    /// One picture of a ring of cameras with and without gains, the first image at one fence and the last at the other.
    fn ring<T: Bilinear + Mix + Number>(&mut self, lut: &RigLut, channels: usize, random: &mut Random) {
        let (width, height) = (lut.source_size(0).0 as usize, lut.source_size(0).1 as usize);
        let data: Vec<T> = noise(width * height * channels * lut.cameras(), random);
        let border: Vec<T> = noise(channels, random);
        let gains: Vec<f32> = (0..channels * lut.cameras()).map(|k| 0.8 + 0.03 * k as f32).collect();
        for interpolation in [Interpolation::Nearest, Interpolation::Bilinear, Interpolation::Area] {
            for gains in [&[][..], &gains] {
                let mut run = |isa: Isa, (source_guard, out_guard): (Guard, Guard)| -> Vec<T> {
                    let what = format!(
                        "\nfault: {}, {interpolation:?} of a ring of {} x{channels}, {} gains, guard {source_guard:?} the \
                         images and {out_guard:?} the output\n\0",
                        isa.name(),
                        std::any::type_name::<T>(),
                        gains.len(),
                    );
                    let source = self.source.samples::<T>(data.len(), source_guard);
                    source.copy_from_slice(&data);
                    let images: Vec<_> = (source.chunks(width * height * channels))
                        .map(|image| ImageView::new(image, (width, height), channels).expect("an image"))
                        .collect();
                    let cells = lut.rows() * lut.columns();
                    let out = self.out.samples::<T>(cells * channels, out_guard);
                    let mut view = ImageViewMut::new(out, (lut.columns(), lut.rows()), channels).expect("a picture");
                    let border_value = border.clone();
                    let options = WarpOptions {
                        interpolation,
                        isa: Some(isa),
                        threads: Some(1),
                        border_value,
                        border_mode: None,
                    };
                    TRYING.store(what.as_ptr().cast_mut().cast(), Ordering::Relaxed);
                    lut.warp_into(&images, &mut view, &options, gains).expect("the images fit the table");
                    TRYING.store(ptr::null_mut(), Ordering::Relaxed);
                    out.to_vec()
                };
                let expected = run(Isa::Scalar, GUARDS[0]);
                for isa in compared().chain([Isa::Scalar]) {
                    for guards in GUARDS {
                        let same = run(isa, guards).iter().zip(&expected).all(|(&got, &expected)| got.same(expected));
                        assert!(same, "{interpolation:?} x{channels}, {} gains: {} differs", gains.len(), isa.name());
                    }
                }
            }
        }
    }

    fn area<T: Bilinear + Number>(&mut self, size: (usize, usize), channels: usize, random: &mut Random) {
        self.try_all(&Job::<T>::area(), size, channels, random);
    }

    fn direct<T: Bilinear + Number>(&mut self, size: (usize, usize), channels: usize, random: &mut Random) {
        self.try_all(&Job::<T>::direct(), size, channels, random);
    }

    /// Sums of 4 x 4 and 8 x 8 pixels.
    fn wide<T: Bilinear + Number>(&mut self, size: (usize, usize), channels: usize, random: &mut Random) {
        for interpolation in [Interpolation::Cubic, Interpolation::Lanczos4] {
            self.try_all(&Job::<T> { warp: Lut::warp_into, interpolation }, size, channels, random);
        }
    }

    fn nearest<T: Number>(&mut self, size: (usize, usize), channels: usize, random: &mut Random) {
        self.try_all(&Job::<T>::nearest(), size, channels, random);
    }
}

/// Four small cameras around a car, whose seams and borders are all in the picture.
fn ring() -> RigLut {
    let camera = |yaw: f64, x: f64, y: f64| {
        let model = Pinhole::new(16.0, 16.5, 19.7, 14.2, 0.0).expect("a pinhole");
        Camera::from_euler(model, (40, 30), [x, y, 1.0], 0.0, 0.7, yaw).expect("a camera")
    };
    let cameras = [
        ("back", camera(3.1, -0.9, 0.1)),
        ("front", camera(0.0, 3.7, 0.0)),
        ("left", camera(1.5, 1.9, 0.9)),
        ("right", camera(-1.6, 1.9, -0.9)),
    ];
    let grid = BevGrid::new((-3.0, 7.0), (-4.0, 4.0), (0.25, 0.1), SampleAt::Center).expect("a grid");
    RigLut::new(&cameras, &grid, &Ground::default(), &RigOptions::default()).expect("a table")
}

/// One test, because `TRYING` is one.
#[test]
fn no_byte_outside_the_image_or_the_output() {
    announce_faults();
    let mut random = Random::new(5);
    let mut pages = Pages { source: Fenced::new(1 << 20), out: Fenced::new(1 << 17) };
    let ring = ring();
    for channels in [1, 2, 3, 4, 5] {
        pages.ring::<u8>(&ring, channels, &mut random);
        pages.ring::<u16>(&ring, channels, &mut random);
        pages.ring::<f32>(&ring, channels, &mut random);
    }
    pages.ring::<i16>(&ring, 3, &mut random);
    pages.ring::<F16>(&ring, 3, &mut random);
    pages.ring::<f64>(&ring, 1, &mut random);
    // from images smaller than any vector to images wider than any window
    for size in [(2, 2), (3, 3), (7, 2), (19, 4), (40, 3), (150, 2), (150, 9)] {
        for channels in [1, 2, 3, 4, 5, 6, 7, 8, 9, 16] {
            pages.bilinear::<u8>(size, channels, &mut random);
            pages.bilinear::<u16>(size, channels, &mut random);
            pages.bilinear::<f32>(size, channels, &mut random);
            pages.nearest::<u8>(size, channels, &mut random);
            pages.area::<u8>(size, channels, &mut random);
            pages.direct::<f32>(size, channels, &mut random);
        }
        for channels in [1, 2, 3, 4, 5] {
            pages.bilinear::<i8>(size, channels, &mut random);
            pages.bilinear::<i16>(size, channels, &mut random);
            pages.bilinear::<F16>(size, channels, &mut random);
            pages.bilinear::<f64>(size, channels, &mut random);
            pages.direct::<F16>(size, channels, &mut random);
            pages.direct::<f64>(size, channels, &mut random);
        }
        for channels in [1, 3] {
            pages.wide::<u8>(size, channels, &mut random);
            pages.wide::<f32>(size, channels, &mut random);
        }
        pages.wide::<u16>(size, 4, &mut random);
        pages.planes::<f32>(size, &mut random);
        pages.planes::<u8>(size, &mut random);
        pages.area::<i16>(size, 3, &mut random);
        pages.area::<F16>(size, 3, &mut random);
        pages.area::<f64>(size, 3, &mut random);
        for channels in [1, 2, 3, 4] {
            pages.nearest::<u16>(size, channels, &mut random);
            pages.nearest::<u32>(size, channels, &mut random);
            pages.nearest::<u64>(size, channels, &mut random);
        }
        others::borders::<u8>(&mut pages, size, 3, &mut random);
        others::borders::<f32>(&mut pages, size, 1, &mut random);
        others::adjoints(&mut pages, size, &mut random);
        others::labels(&mut pages, size, &mut random);
    }
    others::clouds(&mut pages, &mut random);
    others::rasters(&mut pages, &mut random);
    others::mosaics(&mut pages, &mut random);
}
