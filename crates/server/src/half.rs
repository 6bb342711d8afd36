//! Half-precision floats: the CT goes to the GPU as `R16F`, which every WebGL2 filters linearly. HU up to 2048 are exact.

/// The nearest half-precision number (ties to even) of an integer of at most 16 bits, as its bits.
pub(crate) fn from_i16(value: i16) -> u16 {
    let sign = if value < 0 { 0x8000 } else { 0 };
    let magnitude = u32::from(value.unsigned_abs());
    if magnitude == 0 {
        return 0;
    }
    let exponent = magnitude.ilog2();
    // Ten bits of mantissa behind the leading one.
    let (mantissa, carry) = if exponent <= 10 {
        ((magnitude << (10 - exponent)) & 0x3ff, 0)
    } else {
        let shift = exponent - 10;
        let (kept, rest, half) = (magnitude >> shift, magnitude & ((1 << shift) - 1), 1 << (shift - 1));
        let up = u32::from(rest > half || (rest == half && kept & 1 == 1));
        let rounded = kept + up;
        (rounded & 0x3ff, rounded >> 11)
    };
    sign | ((exponent + 15 + carry) << 10 | mantissa) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(bits: u16) -> f64 {
        let (e, m) = (i32::from(bits >> 10 & 31), f64::from(bits & 0x3ff));
        let v = if e == 0 { m / 1024.0 * 2f64.powi(-14) } else { (1.0 + m / 1024.0) * 2f64.powi(e - 15) };
        if bits >> 15 == 1 { -v } else { v }
    }

    #[test]
    fn every_integer_is_within_half_a_unit_in_the_last_place() {
        for i in i16::MIN..=i16::MAX {
            let error = (value(from_i16(i)) - f64::from(i)).abs();
            let unit = 2f64.powi(i32::from(i).unsigned_abs().max(1).ilog2() as i32 - 10);
            assert!(error <= unit / 2.0 && (i.unsigned_abs() > 2048 || error == 0.0), "{i}");
        }
    }
}
