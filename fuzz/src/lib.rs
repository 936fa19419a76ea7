//! What fuzzers try: each target makes of any bytes a call that a program could make, and holds the answer to what the
//! library promises. A panic, a byte beyond an image, an answer that is not what the definition says, or one that differs
//! between instruction sets ends the run.
//!
//! `fuzz_targets` gives them to libFuzzer, `tests/stable.rs` to proptest. A new target is a module with `run`, a line in
//! [`TARGETS`] and one in `Cargo.toml`.

pub mod adjoints;
pub mod depths;
pub mod homographies;
mod input;
pub mod lenses;
pub mod maps;
pub mod mosaics;
pub mod rasters;
pub mod roads;
pub mod rows;
pub mod tables;
mod uses;

#[path = "../../tests/common/fenced.rs"]
mod fenced;
#[path = "../../tests/common/isas.rs"]
mod isas;

/// Every target by its name.
pub const TARGETS: [(&str, fn(&[u8])); 10] = [
    ("adjoints", adjoints::run),
    ("depths", depths::run),
    ("homographies", homographies::run),
    ("lenses", lenses::run),
    ("maps", maps::run),
    ("mosaics", mosaics::run),
    ("rasters", rasters::run),
    ("roads", roads::run),
    ("rows", rows::run),
    ("tables", tables::run),
];
