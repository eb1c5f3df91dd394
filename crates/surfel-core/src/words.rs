//! Numbers, lengths and cut texts in sentences for the user.

use std::fmt::Display;

/// Formats a number of things, as `1 point` or `12 points`. `thing` is the singular of a noun whose plural ends in s.
pub fn counted<N: Display + From<u8> + PartialEq>(n: N, thing: &str) -> String {
    let ending = if n == N::from(1) { "" } else { "s" };
    format!("{n} {thing}{ending}")
}

/// Cuts a text, which may be megabytes long, to so many characters for a message.
pub fn shorten(text: &str, max_chars: usize) -> String {
    match text.char_indices().nth(max_chars) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// Formats a length with three significant digits, as 0.459, 7.63 or 4120.
pub fn format_length(length: f32) -> String {
    if length == 0.0 {
        return "0".to_owned();
    }
    if !(1e-6..1e9).contains(&length) {
        return format!("{length:.2e}");
    }
    let digits = (2 - length.log10().floor() as i32).max(0) as usize;
    format!("{length:.digits$}")
}

#[cfg(test)]
mod tests {
    //! One, none and many; cut texts; lengths of all sizes.

    use super::*;

    #[test]
    fn one_thing_is_singular() {
        let counts = [0, 1, 2].map(|n| counted(n, "point"));
        assert_eq!(counts, ["0 points", "1 point", "2 points"]);
    }

    #[test]
    fn long_texts_are_cut_between_characters() {
        let cut = ["", "höhe", "höhen"].map(|text| shorten(text, 4));
        assert_eq!(cut, ["", "höhe", "höhe..."]);
    }

    #[test]
    fn lengths_have_three_digits() {
        let lengths = [0.000_045_67, 0.4591, 7.634, 4120.3, 0.0, 3e12].map(format_length);
        assert_eq!(lengths, ["0.0000457", "0.459", "7.63", "4120", "0", "3.00e12"]);
    }
}
