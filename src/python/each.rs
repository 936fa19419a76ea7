//! A result for each row of an array, by several threads.

use numpy::{Element, PyArray1, PyArray2};
use pyo3::prelude::*;

use super::cloud::{Projected, ProjectedArrays};
use super::convert::rows_to_numpy;
use super::detached;
use super::outputs::{Given, Input, Numbers};
use crate::Projection;
use crate::parallel::{self, num_threads};
use crate::view::buffer;

/// What memory is asked for, in errors.
pub(super) const WHAT: &str = "points";

/// Writes `work` of every item, in order; the result does not depend on `threads`. For work of 10 ns an item and more.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted).
fn fill<T: Sync, U: Send>(
    threads: usize,
    items: &[T],
    results: &mut [U],
    work: impl Fn(&T) -> U + Sync,
) -> crate::Result<()> {
    /// A job of 10 us or more.
    const ITEMS_A_JOB: usize = 1024;
    let jobs = items.chunks(ITEMS_A_JOB).zip(results.chunks_mut(ITEMS_A_JOB));
    let threads = if items.len() <= 2 * ITEMS_A_JOB { 1 } else { threads };
    parallel::for_each(threads, jobs, |(items, results)| {
        for (result, item) in results.iter_mut().zip(items) {
            *result = work(item);
        }
        Ok(())
    })
}

/// [`fill`] of new memory.
///
/// # Errors
/// [`Error::OutOfMemory`](crate::Error::OutOfMemory) too.
pub(super) fn map<T: Sync, U: bytemuck::Zeroable + Send>(
    threads: usize,
    items: &[T],
    work: impl Fn(&T) -> U + Sync,
) -> crate::Result<Vec<U>> {
    let mut results = buffer::zeroed(WHAT, items.len())?;
    fill(threads, items, &mut results, work)?;
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

/// [`each_row`] into an array that may be given, which must not share memory with `input`.
pub(super) fn each_row_into<'py, T: Sync, const K: usize>(
    py: Python<'py>,
    threads: Option<usize>,
    items: &[T],
    input: Input<'_, 'py>,
    out: Option<Given<'py>>,
    row: impl Fn(&T) -> [f64; K] + Sync + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let threads = threads.unwrap_or_else(num_threads);
    let out = Numbers::<f64>::new(py, out, &[items.len(), K], &[input])?;
    let mut write = out.write("out")?;
    let rows = write.as_slice_mut()?.as_chunks_mut().0;
    detached::run(py, || fill(threads, items, rows, row))?;
    drop(write);
    Ok(out.into_object())
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
    out: ProjectedArrays<'py>,
    project: impl Fn(&T) -> Projection + Sync + Send,
) -> PyResult<Projected<'py>> {
    let threads = threads.unwrap_or_else(num_threads);
    let row = |item: &T| {
        let Projection { pixel: [u, v], depth, valid } = project(item);
        [u, v, depth, f64::from(u8::from(valid))]
    };
    out.write(py, |out| {
        let rows = map(threads, items, row)?;
        for (i, &[u, v, depth, valid]) in rows.iter().enumerate() {
            (out.uv[i], out.depth[i], out.valid[i]) = ([u, v], depth, valid != 0.0);
        }
        Ok(())
    })
}

/// Numbers as a new array: `PyArray::from_iter` would end the process where there is no memory.
pub(super) fn numbers<'py, E: Element>(
    py: Python<'py>,
    numbers: impl ExactSizeIterator<Item = E>,
) -> PyResult<Bound<'py, PyArray1<E>>> {
    Ok(PyArray1::from_vec(py, buffer::collected(WHAT, numbers)?))
}
