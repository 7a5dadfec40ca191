//! A sine that is the same on every machine.

/// Angles in the table, a power of two.
const STEPS: usize = 1024;

/// The sines of a turn, times 16384. It is Bhaskara's formula, off by 0.0017 at most:
/// 4 x (180 - x) / (40500 - x (180 - x)) in degrees.
const TABLE: [i16; STEPS] = {
    let mut table = [0; STEPS];
    let half = STEPS as i64 / 2;
    let mut i = 0;
    while i < STEPS {
        let x = i as i64 % half;
        let product = x * (half - x);
        let sine = 16_384 * 16 * product / (5 * half * half - 4 * product);
        table[i] = if i < STEPS / 2 { sine } else { -sine } as i16;
        i += 1;
    }
    table
};

/// The sine of an angle of which 65536 are a turn, times 16384.
#[inline]
pub(super) fn sine(angle: u16) -> i32 {
    let step = (usize::from(angle) * STEPS) >> 16;
    i32::from(TABLE[step & (STEPS - 1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_a_sine() {
        for angle in 0..=u16::MAX {
            let exact = (f64::from(angle) / 65_536.0 * core::f64::consts::TAU).sin();
            let error = f64::from(sine(angle)) / 16_384.0 - exact;
            // The formula's error and that of a step.
            assert!(error.abs() < 0.001_8 + 0.006_2, "{angle} {error}");
        }
    }
}
