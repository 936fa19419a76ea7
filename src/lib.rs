//! Metric bird's-eye views from calibrated cameras: inverse perspective mapping.
//!
//! ```
//! use ipm_rs::{BevGrid, Camera, Ground, ImageView, Lut, Pinhole, SampleAt, WarpOptions};
//!
//! # fn main() -> ipm_rs::Result<()> {
//! let lens = Pinhole::new(800.0, 800.0, 639.5, 359.5, 0.0)?;
//! let pitch = 5f64.to_radians(); // positive pitch looks down
//! let camera = Camera::from_euler(lens, (1280, 720), [1.5, 0.0, 1.4], 0.0, pitch, 0.0)?;
//! let grid = BevGrid::new((6.0, 36.0), (-8.0, 8.0), (0.1, 0.1), SampleAt::Center)?;
//! let lut = Lut::new(&camera, &grid, &Ground::default())?; // built once, used for every frame
//! let frame = vec![128u8; 1280 * 720 * 3];
//! let bev = lut.warp(&ImageView::new(&frame, (1280, 720), 3)?, &WarpOptions::default())?;
//! assert_eq!(bev.len(), 300 * 160 * 3);
//! # Ok(())
//! # }
//! ```
//!
//! Frames: vehicle ISO 8855 (x forward, y left, z up, metres), camera optical (x right, y down, z forward), pixel (0, 0)
//! the centre of the top-left pixel. Transforms are named `dst_from_src`, angles are in radians.
//!
//! # Features
//!
//! None by default: plain Rust, with `nalgebra`, `rayon` and `bytemuck`. `python` is the binding of the Python package
//! `ipm-rs`, for `maturin` alone: it builds an extension module, which no Rust program can be linked with.
//!
//! Kernels are chosen as the program runs: AVX2 and AVX-512 on x86-64, NEON on aarch64, plain Rust anywhere. All give the same
//! answer to the last bit. `IPM_RS_ISA` names another one, `IPM_RS_NUM_THREADS` or [`set_num_threads`] the threads.
//!
//! # Rust versions
//!
//! 1.89 or newer, for AVX-512. It moves in a minor version, to a compiler that is at least six months old.

mod camera;
pub mod cloud;
mod digits;
pub mod error;
mod finding;
pub mod geometry;
mod grid;
mod ground;
mod isa;
mod kernels;
mod lut;
pub mod mosaic;
mod parallel;
#[cfg(feature = "python")]
mod python;
pub mod raster;
pub mod refine;
pub mod rig;
mod table;
pub mod view;
pub mod warp;

pub use camera::{
    Binning, BrownConrady, Camera, Cylindrical, Division, DoubleSphere, Equirectangular, Eucm, FTheta, FThetaForm, Fov,
    InverseBrownConrady, KannalaBrandt, Lens, Mei, Ocam, Pinhole, Projection, RadialPolynomial, RangeError,
    ThinPrismFisheye,
};
pub use error::{Error, Result};
pub use finding::{Finding, Unseen};
pub use grid::{BevGrid, SampleAt};
pub use ground::{Ground, HeightMap, Plane};
pub use isa::{Isa, cpu_features};
pub use lut::Lut;
pub use parallel::{ignored_variable, interruptible, num_threads, set_num_threads};
pub use table::{BorderMode, checksum};
pub use view::{F16, ImageMask, ImageView, ImageViewMut, MAX_CELLS, Sample};
pub use warp::direct::{Mapping, inverse_homography, warp_direct_into, warp_direct_nearest_into};
pub use warp::{Bilinear, Interpolation, WarpOptions};
