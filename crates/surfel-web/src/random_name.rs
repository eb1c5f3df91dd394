//! Names that nobody can guess.

use crate::scene_provider::{Error, Result};

/// Number of random bytes in a name.
const NAME_BYTES: usize = 16;

/// Returns a name of random hexadecimal digits.
///
/// # Errors
///
/// Fails if the system has no random numbers.
pub fn random_name() -> Result<String> {
    let mut bytes = [0; NAME_BYTES];
    let failed = |error| Error::Failed(format!("the system has no random numbers: {error}"));
    getrandom::fill(&mut bytes).map_err(failed)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    //! The form of names.

    use super::*;

    #[test]
    fn names_differ_and_are_hexadecimal() {
        let names = [random_name().unwrap(), random_name().unwrap()];
        assert_ne!(names[0], names[1]);
        for name in names {
            assert!(name.len() == 2 * NAME_BYTES && u128::from_str_radix(&name, 16).is_ok());
        }
    }
}
