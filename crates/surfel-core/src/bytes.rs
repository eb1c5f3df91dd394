//! Numbers of bytes in messages.

/// Returns bytes in the largest unit that leaves a number above one; each unit is 1024 of the one before.
pub fn readable(bytes: u64) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB"];
    let power = (bytes.max(1).ilog2() / 10).min(4);
    let value = bytes as f64 / 1024f64.powi(power as i32);
    let digits = usize::from(0 < power);
    format!("{value:.digits$} {}", units[power as usize])
}

#[cfg(test)]
mod tests {
    //! The unit follows the size.

    use super::*;

    #[test]
    fn the_unit_follows_the_size() {
        let texts = [0, 1023, 1024, 3 << 19, 80 << 30, u64::MAX].map(readable);
        assert_eq!(texts, ["0 B", "1023 B", "1.0 KiB", "1.5 MiB", "80.0 GiB", "16777216.0 TiB"]);
    }
}
