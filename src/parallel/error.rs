//! What is wrong with a number of threads.

/// A number of threads that cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ThreadsError {
    /// A thread count below one.
    #[error("threads: expected at least 1, got {got}")]
    Zero {
        /// The count that came.
        got: usize,
    },
    /// More threads than can be of use.
    #[error("threads: expected at most {limit}, got {got}; as many as there are CPUs are enough")]
    TooMany {
        /// The count that came.
        got: usize,
        /// The limit.
        limit: usize,
    },
}
