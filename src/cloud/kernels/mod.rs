//! The loops that a cloud spends its time in, as plain Rust without branches: the compiler makes vectors of them for
//! each instruction set (decision 0005). Nothing is fused or reordered, so all give the same answers to the last bit.

mod decode;
mod points;
mod project;

pub(super) use decode::{Decode, Encode};
pub(super) use points::{PinholeRays, PointsRow, Rotate, Unit};
pub(super) use project::ProjectPinhole;

pub(super) use crate::cpu::{Body, run};
