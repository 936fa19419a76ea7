//! Where the search for a distance from the centre begins, for lenses whose formula goes the other way.

/// Terms of the polynomial. With 14, two steps of Newton's settle up to 135, 97 and 92 degrees, the whole domains of two,
/// with the lenses of Scaramuzza's model that we know; with 10, up to 107, 82 and 92.
const TERMS: usize = 14;
/// Chebyshev's nodes on 0 to 1, at which it is exact.
const NODES: [f64; TERMS] = [
    0.003_143_895_053_378_698,
    0.028_058_334_845_816_213,
    0.076_637_900_385_857_94,
    0.146_446_609_406_726_2,
    0.233_983_961_742_331_71,
    0.334_860_469_022_416_34,
    0.444_017_761_948_346_13,
    0.555_982_238_051_653_8,
    0.665_139_530_977_583_6,
    0.766_016_038_257_668_2,
    0.853_553_390_593_273_7,
    0.923_362_099_614_142_1,
    0.971_941_665_154_183_8,
    0.996_856_104_946_621_4,
];

/// About rho of a direction: `s (c0 + (s - s0) (c1 + (s - s1) (c2 + ...)))` with the nodes s0, s1, ..., and s what tells the
/// direction's angle, in parts of the largest one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    coefficients: [f64; TERMS],
    /// One over the largest that it is good for.
    scale: f64,
}

impl Fit {
    /// Good for no direction: s is infinite, or on the axis NaN.
    pub(super) const NONE: Self = Self { coefficients: [0.0; TERMS], scale: f64::INFINITY };

    /// The fit over the largest part of the domain in which searches that begin with it settle: near a fold, and where rho
    /// runs off, no polynomial follows it. `largest` is what tells the angle, at the end of a part of the domain, `exact` is
    /// rho, and `settles` says whether a search from a fit settles.
    pub(super) fn widest(
        largest: impl Fn(f64) -> f64,
        exact: impl Fn(f64) -> f64,
        settles: impl Fn(&Self, f64) -> bool,
    ) -> Self {
        const PARTS: u32 = 32;
        const CHECKS: u32 = 64;
        for part in (1..=PARTS).rev() {
            let largest = largest(f64::from(part) / f64::from(PARTS));
            // divided differences of rho / s
            let mut coefficients = NODES.map(|s| exact(s * largest) / s);
            for order in 1..TERMS {
                for i in (order..TERMS).rev() {
                    coefficients[i] = (coefficients[i] - coefficients[i - 1]) / (NODES[i] - NODES[i - order]);
                }
            }
            let fit = Self { coefficients, scale: 1.0 / largest };
            let at = |check: u32| (largest * f64::from(check) / f64::from(CHECKS)).min((1.0 - 1e-12) * largest);
            if (0..=CHECKS).all(|check| settles(&fit, at(check))) {
                return fit;
            }
        }
        Self::NONE
    }

    /// About rho, and whether the fit is good there.
    #[inline(always)]
    pub(super) fn at(&self, told: f64) -> (f64, bool) {
        let s = told * self.scale;
        let mut sum = self.coefficients[TERMS - 1];
        let mut term = TERMS - 1;
        while term > 0 {
            term -= 1;
            sum = sum * (s - NODES[term]) + self.coefficients[term];
        }
        (sum * s, s <= 1.0)
    }

    /// One over the largest that it is good for.
    #[cfg(test)]
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }
}
