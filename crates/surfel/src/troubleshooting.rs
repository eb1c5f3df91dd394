//! References from messages to sections of docs/troubleshooting.md.

/// A section of docs/troubleshooting.md.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TroubleshootingSection {
    /// A colour is missing or not what the user expects.
    WrongColors,
    /// Nothing is visible.
    EmptyPicture,
    /// The work would take more memory than it may.
    OutOfMemory,
}

impl TroubleshootingSection {
    /// Returns the heading of the section.
    pub fn title(self) -> &'static str {
        match self {
            Self::WrongColors => "Wrong colours",
            Self::EmptyPicture => "Empty picture",
            Self::OutOfMemory => "Out of memory",
        }
    }
}

impl std::fmt::Display for TroubleshootingSection {
    /// Writes the end of a message.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "see \"{}\" in docs/troubleshooting.md", self.title())
    }
}

#[cfg(test)]
mod tests {
    //! Sections that messages name exist.

    use super::*;

    #[test]
    fn every_section_is_a_heading_of_the_page() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/troubleshooting.md");
        let text = std::fs::read_to_string(page).unwrap();
        use TroubleshootingSection::{EmptyPicture, OutOfMemory, WrongColors};
        for section in [WrongColors, EmptyPicture, OutOfMemory] {
            assert!(text.contains(&format!("\n## {}\n", section.title())), "{section}");
        }
    }
}
