//! Reads what is whole of damaged files, if that is asked for.

use surfel_core::progress::Progress;
use surfel_core::words::counted;

use crate::error::{Error, Result};
use crate::file::Input;

/// The damage of an input, which ends its reading unless salvage is on.
pub(crate) struct Salvage<'a> {
    /// Input that is read.
    pub input: &'a Input<'a>,
    /// True if what is whole is read.
    pub is_on: bool,
    /// The first damage.
    damage: Option<Error>,
}

impl<'a> Salvage<'a> {
    /// An input without damage so far.
    pub fn new(input: &'a Input<'a>, is_on: bool) -> Self {
        Self { input, is_on, damage: None }
    }

    /// Accepts damage that leaves something whole.
    ///
    /// Fails with it, and with advice to salvage, if salvage is off; and with errors that are no damage.
    pub fn accept(&mut self, error: Error) -> Result<()> {
        let damage = self.check(error)?;
        self.damage.get_or_insert(damage);
        Ok(())
    }

    /// Returns true if damage was accepted.
    pub fn is_damaged(&self) -> bool {
        self.damage.is_some()
    }

    /// Returns damage that may be accepted later; fails as `accept` does.
    pub fn check(&self, mut error: Error) -> Result<Error> {
        let (Error::Malformed { advice, .. } | Error::Truncated { advice, .. }) = &mut error else {
            return Err(error);
        };
        if !self.is_on {
            advice.to_mut().push_str("; what is whole can be read [salvage]");
            return Err(error);
        }
        Ok(error)
    }

    /// Reports how many of the `claimed` points or other things were read in spite of damage; fails if there are none. `thing` is
    /// the singular.
    pub fn report(
        self,
        thing: &str,
        readable: u64,
        claimed: Option<u64>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let Some(damage) = self.damage else { return Ok(()) };
        if readable == 0 {
            return Err(damage);
        }
        let things = match claimed {
            Some(claimed) => format!("{readable} of {}", counted(claimed, thing)),
            None => counted(readable, thing),
        };
        progress.note(&format!("{}: salvaged {things}; {}", self.input.name, damage.damage()));
        Ok(())
    }
}
