//! What a cell collects: one record with everything that is asked for, so that a point costs one cache miss.
//!
//! The values of a cell come in the order of its points. Nothing branches: whether a cell is empty is only known when its
//! record has arrived, and a wrong guess would cost as much as the wait.

use crate::view::PointSample;

/// What a cell, or one channel of it, has collected.
pub(super) trait Record<T>: Copy + Send + Sync + 'static {
    /// What an empty cell has collected.
    const EMPTY: Self;
    /// Takes a value in.
    fn add(&mut self, value: T);
    /// How many values there are.
    fn count(&self) -> i32;
    /// The lowest, NaN of none; without meaning where it is not kept, as in the following.
    fn min(&self) -> T;
    /// The highest.
    fn max(&self) -> T;
    /// The last.
    fn last(&self) -> T;
    /// Their sum.
    fn sum(&self) -> f64;
}

/// The number of points alone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Count(i32);

/// Number, sum and highest value: what is asked for most.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak<T> {
    sum: f64,
    max: T,
    count: i32,
}

/// Everything.
#[derive(Debug, Clone, Copy)]
pub(super) struct Full<T> {
    sum: f64,
    min: T,
    max: T,
    last: T,
    count: i32,
}

impl<T: PointSample> Record<T> for Count {
    const EMPTY: Self = Self(0);
    #[inline(always)]
    fn add(&mut self, _: T) {
        self.0 += 1;
    }
    #[inline(always)]
    fn count(&self) -> i32 {
        self.0
    }
    fn min(&self) -> T {
        T::NAN
    }
    fn max(&self) -> T {
        T::NAN
    }
    fn last(&self) -> T {
        T::NAN
    }
    fn sum(&self) -> f64 {
        0.0
    }
}

impl<T: PointSample> Record<T> for Peak<T> {
    const EMPTY: Self = Self { sum: 0.0, max: T::NAN, count: 0 };

    #[inline(always)]
    fn add(&mut self, value: T) {
        // NaN is not above anything
        self.max = if self.max > value { self.max } else { value };
        self.sum += value.to_f64();
        self.count += 1;
    }
    #[inline(always)]
    fn count(&self) -> i32 {
        self.count
    }
    #[inline(always)]
    fn min(&self) -> T {
        T::NAN
    }
    #[inline(always)]
    fn max(&self) -> T {
        self.max
    }
    #[inline(always)]
    fn last(&self) -> T {
        T::NAN
    }
    #[inline(always)]
    fn sum(&self) -> f64 {
        self.sum
    }
}

impl<T: PointSample> Record<T> for Full<T> {
    const EMPTY: Self = Self { sum: 0.0, min: T::NAN, max: T::NAN, last: T::NAN, count: 0 };

    #[inline(always)]
    fn add(&mut self, value: T) {
        // NaN is neither below nor above anything
        self.min = if self.min < value { self.min } else { value };
        self.max = if self.max > value { self.max } else { value };
        self.last = value;
        self.sum += value.to_f64();
        self.count += 1;
    }
    #[inline(always)]
    fn count(&self) -> i32 {
        self.count
    }
    #[inline(always)]
    fn min(&self) -> T {
        self.min
    }
    #[inline(always)]
    fn max(&self) -> T {
        self.max
    }
    #[inline(always)]
    fn last(&self) -> T {
        self.last
    }
    #[inline(always)]
    fn sum(&self) -> f64 {
        self.sum
    }
}
