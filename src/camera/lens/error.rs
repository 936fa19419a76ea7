//! What is wrong with a lens.

/// A lens that no lens can be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LensError {
    /// A lens with another number of coefficients than its model has.
    #[error("{lens}: expected {expected} coefficients, got {got}")]
    Coefficients {
        /// The model.
        lens: &'static str,
        /// Their number, and what they are.
        expected: &'static str,
        /// How many came.
        got: usize,
    },
    /// A lens parameter that its model cannot have.
    #[error("{lens}: {name}: expected {expected}, got {got}")]
    Parameter {
        /// The model.
        lens: &'static str,
        /// The parameter's name.
        name: &'static str,
        /// What it must be.
        expected: &'static str,
        /// The number that came.
        got: f64,
    },
    /// A lens that sees nothing beside its axis.
    #[error(
        "{lens}: expected {expected} coefficients of a lens that sees more than its axis, got ones whose image folds back {angle:.2e} rad from it; check their order, their signs and their units"
    )]
    Folds {
        /// The model.
        lens: &'static str,
        /// Its coefficients, in order.
        expected: &'static str,
        /// Radians from the axis.
        angle: f64,
    },
}
