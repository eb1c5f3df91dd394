//! Names and colours of the ASPRS classes (LAS 1.4, table 17).

/// Returns the sRGB-encoded colour of a class. Classes 1 to 9 have those of Potree's default scheme, 0 a lighter grey
/// than 1, 10 to 22 distinct colours in place of Potree's yellow, and all others Potree's colour for unknown classes.
pub fn class_color(class: u8) -> [u8; 3] {
    CLASSES.get(usize::from(class)).map_or(UNKNOWN, |(_, color)| *color)
}

/// Returns the name of a class, or the standard's term for the range of its number.
pub fn class_name(class: u8) -> &'static str {
    match (CLASSES.get(usize::from(class)), class) {
        (Some((name, _)), _) => name,
        (None, ..64) => "reserved",
        (None, _) => "user definable",
    }
}

/// Returns the class of a name of its own; case and separators do not matter, as in `low_vegetation`.
pub fn class_named(name: &str) -> Option<u8> {
    let letters = |name: &str| {
        name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase()
    };
    let named = CLASSES.iter().position(|(known, _)| letters(known) == letters(name));
    named.map(|class| class as u8)
}

/// Colour of unknown classes.
const UNKNOWN: [u8; 3] = [77, 153, 153];

/// Names and sRGB-encoded colours of the classes by number.
const CLASSES: [(&str, [u8; 3]); 23] = [
    ("never classified", [176, 176, 176]),
    ("unclassified", [128, 128, 128]),
    ("ground", [161, 82, 46]),
    ("low vegetation", [0, 255, 0]),
    ("medium vegetation", [0, 204, 0]),
    ("high vegetation", [0, 153, 0]),
    ("building", [255, 168, 0]),
    ("low noise", [255, 0, 255]),
    ("model key-point", [255, 0, 0]),
    ("water", [0, 0, 255]),
    ("rail", [110, 70, 140]),
    ("road surface", [70, 70, 78]),
    ("overlap", [255, 255, 0]),
    ("wire guard", [190, 235, 245]),
    ("wire conductor", [0, 200, 255]),
    ("transmission tower", [120, 130, 255]),
    ("wire connector", [0, 110, 170]),
    ("bridge deck", [205, 175, 120]),
    ("high noise", [200, 0, 110]),
    ("overhead structure", [255, 110, 90]),
    ("ignored ground", [110, 90, 60]),
    ("snow", [240, 245, 255]),
    ("temporal exclusion", [170, 200, 60]),
];

#[cfg(test)]
mod tests {
    //! Names and colours of classes.

    use super::*;

    #[test]
    fn classes_have_their_names_and_colors() {
        assert_eq!((class_name(2), class_color(2)), ("ground", [161, 82, 46]));
        assert_eq!((class_name(9), class_color(9)), ("water", [0, 0, 255]));
        assert_eq!((class_name(30), class_color(30)), ("reserved", UNKNOWN));
        assert_eq!((class_name(200), class_color(200)), ("user definable", UNKNOWN));
        assert_eq!(
            ["Ground", "low_vegetation", "reserved"].map(class_named),
            [Some(2), Some(3), None]
        );
    }

    #[test]
    fn colors_are_distinct() {
        for a in 0..23 {
            for b in a + 1..=23 {
                let difference =
                    class_color(a).into_iter().zip(class_color(b)).map(|(a, b)| a.abs_diff(b));
                assert!(40 <= difference.max().unwrap(), "{a} {b}");
            }
        }
    }
}
