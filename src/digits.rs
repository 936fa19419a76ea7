//! How messages write numbers.

/// A number of cells, in powers of ten where it has too many digits to be read.
pub(crate) fn count(cells: f64) -> String {
    if cells < 1e15 { format!("{cells}") } else { format!("{cells:.1e}") }
}

/// A number without the noise of its last bits: 0.9, not 0.8999999999999999.
pub(crate) fn readable(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}
