//! Colours of labels: numbers of segments or objects, of which none is more than another.

/// Fraction of the circle of hues from one number to the next, 2 minus the golden ratio: hues of consecutive numbers
/// are then as far apart as can be, however many there are.
const HUE_STEP: f64 = 0.381_966_011_250_105_1;

/// Saturation and value of consecutive numbers in HSV, so that numbers whose hues are near each other differ too.
const TONES: [(f64, f64); 5] = [(0.8, 0.9), (0.4, 1.0), (0.9, 0.6), (0.45, 0.7), (1.0, 0.4)];

/// Returns the sRGB-encoded colour of a label. Negative numbers, which stand for no segment, are grey.
pub fn label_color(label: i64) -> [u8; 3] {
    if label < 0 {
        return [128; 3];
    }
    let (saturation, value) = TONES[(label % TONES.len() as i64) as usize];
    let hue = 6.0 * (label as f64 * HUE_STEP).fract();
    let channel = |offset: f64| {
        let sector = (offset + hue) % 6.0;
        let darkening = sector.min(4.0 - sector).clamp(0.0, 1.0);
        (255.0 * value * (1.0 - saturation * darkening)).round() as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

#[cfg(test)]
mod tests {
    //! Colours of labels differ.

    use super::*;

    #[test]
    fn colors_of_55_labels_are_distinct() {
        assert_eq!((label_color(-1), label_color(0)), ([128; 3], [230, 46, 46]));
        for a in 0..55 {
            for b in a + 1..55 {
                let pairs = label_color(a).into_iter().zip(label_color(b));
                let difference: u32 = pairs.map(|(a, b)| u32::from(a.abs_diff(b))).sum();
                assert!(40 <= difference, "{a} {b}: {difference}");
            }
        }
        assert_ne!(label_color(i64::MAX), label_color(i64::MAX - 1));
    }
}
