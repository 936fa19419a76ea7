//! A result for each row of an array, by several threads.

use numpy::{Element, PyArray1, PyArray2};
use pyo3::prelude::*;

use super::cloud::Projected;
use super::convert::rows_to_numpy;
use super::detached;
use crate::Projection;
use crate::parallel::{self, num_threads};
use crate::view::buffer;

/// What memory is asked for, in errors.
pub(super) const WHAT: &str = "points";

/// `work` of every item, in order; the result does not depend on `threads`. For work of 10 ns an item and more.
///
/// # Errors
/// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and [`Error::Interrupted`](crate::Error::Interrupted).
pub(super) fn map<T: Sync, U: bytemuck::Zeroable + Copy + Send + Sync>(
    threads: usize,
    items: &[T],
    work: impl Fn(&T) -> U + Sync,
) -> crate::Result<Vec<U>> {
    /// A job of 10 us or more.
    const ITEMS_A_JOB: usize = 1024;
    let mut results = buffer::zeroed(WHAT, items.len())?;
    let jobs = items.chunks(ITEMS_A_JOB).zip(results.chunks_mut(ITEMS_A_JOB));
    let threads = if items.len() <= 2 * ITEMS_A_JOB { 1 } else { threads };
    parallel::for_each(threads, jobs, |(items, results)| {
        for (result, item) in results.iter_mut().zip(items) {
            *result = work(item);
        }
        Ok(())
    })?;
    Ok(results)
}

/// A row for each item; `None` is as many threads as a call uses when it does not say.
pub(super) fn each_row<'py, T: Sync, const K: usize>(
    py: Python<'py>,
    threads: Option<usize>,
    items: &[T],
    row: impl Fn(&T) -> [f64; K] + Sync + Send,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let threads = threads.unwrap_or_else(num_threads);
    rows_to_numpy(py, detached::run(py, || map(threads, items, row))?)
}

/// A number for each item.
pub(super) fn each_number<'py, T: Sync>(
    py: Python<'py>,
    items: &[T],
    number: impl Fn(&T) -> f64 + Sync + Send,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    Ok(PyArray1::from_vec(py, detached::run(py, || map(num_threads(), items, number))?))
}

/// (uv, depth, valid) for each item.
pub(super) fn each_projected<'py, T: Sync>(
    py: Python<'py>,
    threads: Option<usize>,
    items: &[T],
    project: impl Fn(&T) -> Projection + Sync + Send,
) -> PyResult<Projected<'py>> {
    let threads = threads.unwrap_or_else(num_threads);
    let row = |item: &T| {
        let Projection { pixel: [u, v], depth, valid } = project(item);
        [u, v, depth, f64::from(u8::from(valid))]
    };
    let rows = detached::run(py, || map(threads, items, row))?;
    let uv = buffer::collected(WHAT, rows.iter().map(|&[u, v, ..]| [u, v]))?;
    let depth = numbers(py, rows.iter().map(|row| row[2]))?;
    let valid = numbers(py, rows.iter().map(|row| row[3] != 0.0))?;
    Ok((rows_to_numpy(py, uv)?, depth, valid))
}

/// Numbers as a new array: `PyArray::from_iter` would end the process where there is no memory.
pub(super) fn numbers<'py, E: Element>(
    py: Python<'py>,
    numbers: impl ExactSizeIterator<Item = E>,
) -> PyResult<Bound<'py, PyArray1<E>>> {
    Ok(PyArray1::from_vec(py, buffer::collected(WHAT, numbers)?))
}
