//! Files that pages download, in temporary files of the server.

use std::io::Read;
use surfel_formats::TempFile;
use surfel_web::WrittenFile;

/// A file that a page downloads.
pub struct TempDownload {
    /// Number of points or frames.
    pub n_items: u64,
    /// The file.
    pub file: TempFile,
}

impl WrittenFile for TempDownload {
    fn n_items(&self) -> u64 {
        self.n_items
    }

    fn n_bytes(&self) -> u64 {
        self.file.n_bytes()
    }

    fn open(&self) -> std::io::Result<Box<dyn Read + Send>> {
        Ok(Box::new(self.file.open()?))
    }
}
