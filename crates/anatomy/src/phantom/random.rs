//! A small deterministic generator: the same bits on every machine, and no dependency.

/// The splitmix generator (Steele, Lea and Flood 2014). Good enough to vary a head and to make noise; not for statistics or secrets.
#[derive(Debug, Clone)]
pub(super) struct Random(u64);

impl Random {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(super) const fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// Uniform in `low..high`.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.next() >> 11) as f64 / (1u64 << 53) as f64;
        low + (high - low) * unit
    }
}

const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// An almost normal deviate (mean 0, variance 1): the sum of the four 16-bit parts of one random word.
pub(super) fn nearly_normal(random: &mut Random) -> f64 {
    let word = random.next();
    let sum: u64 = (0..4).map(|part| word >> (16 * part) & 0xffff).sum();
    // Four uniform integers on 0..65536 have mean 2 * 65535 and variance (65536^2 - 1) / 3 together.
    (sum as f64 - 131_070.0) / 37_837.227
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_words_are_those_of_the_published_generator() {
        let mut r = Random::new(1_234_567);
        assert_eq!([r.next(), r.next()], [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    #[test]
    fn noise_has_mean_zero_and_variance_one() {
        let mut r = Random::new(5);
        let n = 100_000;
        let values: Vec<f64> = (0..n).map(|_| nearly_normal(&mut r)).collect();
        let mean = values.iter().sum::<f64>() / f64::from(n);
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
        // Five standard errors: 5 / sqrt(n), and 5 sqrt(2 / n) for the variance.
        assert!(mean.abs() < 0.016 && (variance - 1.0).abs() < 0.023, "{mean} {variance}");
    }
}
