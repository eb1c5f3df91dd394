//! The pages of a file, each of which ends with a checksum.

use rayon::prelude::*;
use surfel_core::progress::Progress;

use crate::error::Result;

/// Bytes of a page with its checksum; the standard allows no other size.
pub(super) const PAGE_LENGTH: usize = 1024;
/// Bytes of the header, with which the first page begins.
pub(super) const HEADER_LENGTH: usize = 48;
/// Bytes of a page without its checksum.
const CONTENT_LENGTH: usize = PAGE_LENGTH - 4;
/// Number of pages that a task checks between two checks for cancellation.
const PAGES_PER_TASK: usize = 1 << 12;

/// The content of whole pages, without their checksums.
#[derive(Clone, Copy)]
pub(super) struct Pages<'a> {
    pages: &'a [[u8; PAGE_LENGTH]],
    /// Indices of pages whose content is not to be used, in order.
    broken: &'a [usize],
}

impl<'a> Pages<'a> {
    /// The whole pages of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { pages: bytes.as_chunks().0, broken: &[] }
    }

    /// Pages without those in `broken`, whose indices are in order.
    pub fn without(self, broken: &'a [usize]) -> Self {
        Self { broken, ..self }
    }

    /// Returns the indices of the pages whose checksums are wrong, in order.
    pub fn find_broken(&self, progress: &dyn Progress) -> Result<Vec<usize>> {
        let tasks = self.pages.par_chunks(PAGES_PER_TASK).enumerate();
        let broken = tasks.map(|(task, pages)| {
            progress.check()?;
            let is_broken = |page: &[u8; PAGE_LENGTH]| {
                let (content, checksum) = page.split_at(CONTENT_LENGTH);
                self::checksum(content) != *checksum
            };
            let first = task * PAGES_PER_TASK;
            let broken = pages.iter().enumerate().filter(|(_, page)| is_broken(page));
            Ok(broken.map(|(i, _)| first + i).collect::<Vec<usize>>())
        });
        Ok(broken.collect::<Result<Vec<_>>>()?.concat())
    }

    /// Returns the position in the content of a byte of the file.
    pub fn content_position(byte: u64) -> u64 {
        let (page, rest) = (byte / PAGE_LENGTH as u64, byte % PAGE_LENGTH as u64);
        page * CONTENT_LENGTH as u64 + rest.min(CONTENT_LENGTH as u64)
    }

    /// Returns the byte of the file at a position in the content.
    pub fn file_position(at: u64) -> u64 {
        at / CONTENT_LENGTH as u64 * PAGE_LENGTH as u64 + at % CONTENT_LENGTH as u64
    }

    /// Returns the bytes of the content.
    pub fn len(&self) -> u64 {
        (self.pages.len() * CONTENT_LENGTH) as u64
    }

    /// Returns true if the pages have `length` bytes of content at position `at`, none of them in a broken page.
    pub fn are_whole(&self, at: u64, length: u64) -> bool {
        length <= self.whole_length(at) && at <= self.len()
    }

    /// Returns the number of bytes of content from position `at` to the end or to the next broken page.
    pub fn whole_length(&self, at: u64) -> u64 {
        let is_before = |page: &usize| (*page as u64 + 1) * CONTENT_LENGTH as u64 <= at;
        let next_broken = self.broken.get(self.broken.partition_point(is_before));
        let end = next_broken.map_or(self.len(), |page| *page as u64 * CONTENT_LENGTH as u64);
        end.saturating_sub(at)
    }

    /// Copies the content from position `at` on; returns `None` if it is not whole before `out` is full.
    pub fn copy(&self, at: u64, mut out: &mut [u8]) -> Option<()> {
        if !self.are_whole(at, out.len() as u64) {
            return None;
        }
        let (mut page, mut start) = (at as usize / CONTENT_LENGTH, at as usize % CONTENT_LENGTH);
        while !out.is_empty() {
            let length = out.len().min(CONTENT_LENGTH - start);
            let (front, rest) = out.split_at_mut(length);
            front.copy_from_slice(&self.pages[page][start..start + length]);
            (out, page, start) = (rest, page + 1, 0);
        }
        Some(())
    }

    /// Returns the file whose pages have this content, with valid checksums; the last page ends with zeros.
    pub fn file_of(content: &[u8]) -> Vec<u8> {
        let pages = content.chunks(CONTENT_LENGTH).map(|content| {
            let mut page = [0; PAGE_LENGTH];
            page[..content.len()].copy_from_slice(content);
            let checksum = checksum(&page[..CONTENT_LENGTH]);
            page[CONTENT_LENGTH..].copy_from_slice(&checksum);
            page
        });
        pages.collect::<Vec<_>>().into_flattened()
    }

    /// Returns the next `N` bytes of the content at `at`, if there are as many.
    pub fn bytes<const N: usize>(&self, at: u64) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        self.copy(at, &mut bytes)?;
        Some(bytes)
    }
}

/// Returns the checksum of a page's content. The standard's library writes its most significant byte first.
fn checksum(content: &[u8]) -> [u8; 4] {
    crc32c::crc32c(content).to_be_bytes()
}

#[cfg(test)]
mod tests {
    //! Content that continues over page ends.

    use super::*;

    #[test]
    fn content_continues_over_page_ends() {
        let bytes: Vec<u8> = (0..3 * PAGE_LENGTH).map(|i| (i / 4) as u8).collect();
        let pages = Pages::new(&bytes);
        assert_eq!(pages.len(), 3 * 1020);
        // The last bytes of the first page's content, then the first of the second page.
        assert_eq!(pages.bytes::<4>(1018), Some([254, 254, 0, 0]));
        assert_eq!(Pages::file_position(1020), 1024);
        assert_eq!(Pages::content_position(1026), 1022);
        assert_eq!(pages.bytes::<2>(3 * 1020 - 1), None);
        assert_eq!(pages.bytes::<2>(u64::MAX), None);
    }

    #[test]
    fn broken_pages_have_no_content() {
        let bytes = [0; 4 * PAGE_LENGTH];
        let broken = [1, 2];
        let pages = Pages::new(&bytes).without(&broken);
        let is_whole = |at: u64| pages.bytes::<4>(at).is_some();
        assert_eq!(
            [1016, 1017, 1020, 3059, 3060, 4077].map(is_whole),
            [true, false, false, false, true, false]
        );
        assert!(pages.are_whole(1020, 0) && pages.are_whole(4080, 0));
    }
}
