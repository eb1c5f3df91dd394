//! What all parts of the reader share: the JSON, the buffers, and a limit to what they may grow to.

use std::cell::{Cell, RefCell};

use surfel::progress::Progress;

use super::json::Json;
use super::uri::{Bytes, fetch};
use crate::beside::Beside;
use crate::error::{Error, Result};

/// Decoded bytes that any file may ask for; what is not in a buffer counts as zeros and takes no room there.
const BASE_BYTES: u64 = 64 << 20;
/// Decoded bytes for each that the file has: several meshes may share their vertices.
const BYTES_PER_BYTE: u64 = 64;

const MOST_NOTES: usize = 20;

pub(super) struct Document<'a> {
    pub root: Json<'a>,
    pub beside: &'a Beside<'a>,
    pub progress: &'a dyn Progress,
    buffers: &'a [Buffer<'a>],
    bytes_left: Cell<u64>,
    pictures_left: Cell<u64>,
    notes: RefCell<Vec<(String, usize)>>,
    n_untold: Cell<usize>,
}

/// The bytes of a buffer, unless an extension was to bring them.
pub(super) struct Buffer<'a>(Option<Bytes<'a>>, usize);

/// A part of a buffer.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub bytes: &'a [u8],
    /// Bytes from one element to the next, if the file says so.
    pub stride: Option<usize>,
}

/// Finds the bytes of all buffers.
pub(super) fn load_buffers<'a>(
    root: &Json<'a>,
    chunk: Option<&'a [u8]>,
    beside: &Beside,
) -> Result<Vec<Buffer<'a>>> {
    let mut buffers = Vec::new();
    for (i, buffer) in root.list("buffers")?.into_iter().enumerate() {
        let length = buffer.need("byteLength")?;
        let bytes = match buffer.get("uri") {
            Some(uri) => Some(fetch(beside, &uri)?),
            None if i == 0 => chunk.map(Bytes::Chunk),
            None => None,
        };
        let n_bytes = length.index()?;
        if let Some(bytes) = &bytes
            && bytes.len() < n_bytes
        {
            let found = format!("{n_bytes}, but the buffer has {} bytes", bytes.len());
            return Err(length.error(found, "no more bytes than there are"));
        }
        buffers.push(Buffer(bytes, n_bytes));
    }
    Ok(buffers)
}

impl<'a> Document<'a> {
    /// What is in a file of `n_bytes` and its buffers.
    pub fn new(
        root: Json<'a>,
        buffers: &'a [Buffer<'a>],
        n_bytes: usize,
        beside: &'a Beside<'a>,
        progress: &'a dyn Progress,
    ) -> Self {
        // The buffer of a GLB is in the file itself.
        let outside = buffers.iter().filter_map(|Buffer(bytes, _)| match bytes {
            Some(Bytes::File(_) | Bytes::Decoded(_)) => bytes.as_deref(),
            _ => None,
        });
        let n_bytes = (n_bytes + outside.map(<[u8]>::len).sum::<usize>()) as u64;
        Self {
            root,
            beside,
            progress,
            buffers,
            bytes_left: Cell::new(BASE_BYTES + BYTES_PER_BYTE.saturating_mul(n_bytes)),
            pictures_left: Cell::new(n_bytes),
            notes: RefCell::default(),
            n_untold: Cell::new(0),
        }
    }

    /// The object that `reference` names in one of the lists of the whole file.
    pub fn referred(&self, list: &str, reference: &Json<'a>) -> Result<Json<'a>> {
        self.root.referred(list, reference)
    }

    /// The buffer view that `reference` names.
    pub fn view(&self, reference: &Json<'a>) -> Result<View<'a>> {
        let view = self.referred("bufferViews", reference)?;
        let buffer = view.need("buffer")?;
        self.referred("buffers", &buffer)?;
        let Some(Buffer(bytes, n_bytes)) = self.buffers.get(buffer.index()?) else {
            return Err(buffer.unlike("a buffer"));
        };
        let Some(bytes) = bytes else {
            return Err(buffer.error("a buffer without `uri`", "one whose bytes are there"));
        };
        let (offset, length) = (view.unsigned_or("byteOffset", 0)?, view.need("byteLength")?);
        let end = offset.checked_add(length.unsigned()?).filter(|end| *end <= *n_bytes as u64);
        let Some(end) = end else {
            let found = format!("{} bytes from byte {offset}", length.unsigned()?);
            return Err(view.error(found, format!("a part of the buffer's {n_bytes} bytes")));
        };
        let stride = view.get("byteStride").map(|stride| stride.index()).transpose()?;
        Ok(View { bytes: &bytes[offset as usize..end as usize], stride })
    }

    /// Counts memory that is about to be taken on behalf of `json` against what a file of this size may ask
    /// for: by references to the same bytes over and over, a small one could ask for any amount.
    pub fn charge(&self, json: &Json, n_elements: usize, bytes_each: usize) -> Result<()> {
        let n_bytes = (n_elements as u64).saturating_mul(bytes_each as u64);
        spend(&self.bytes_left, n_bytes).ok_or_else(|| too_large(json, n_bytes))
    }

    /// The same for pictures, which grow much more, so that each byte may be used once only.
    pub fn charge_picture(&self, json: &Json, n_bytes: usize) -> Result<()> {
        spend(&self.pictures_left, n_bytes as u64).ok_or_else(|| too_large(json, n_bytes as u64))
    }

    /// Keeps a line to be told at the end; the same line is told once.
    pub fn note(&self, line: impl Into<String>) {
        let line = line.into();
        let mut notes = self.notes.borrow_mut();
        let is_full = MOST_NOTES <= notes.len();
        match notes.iter_mut().find(|(known, _)| *known == line) {
            Some((_, count)) => *count += 1,
            // A file that is wrong all over shall not fill the screen.
            None if is_full => self.n_untold.set(self.n_untold.get() + 1),
            None => notes.push((line, 1)),
        }
    }

    /// Tells what was kept.
    pub fn tell_notes(&self) {
        let file = self.root.file();
        for (line, count) in self.notes.borrow().iter() {
            match count {
                1 => self.progress.note(&format!("{file}: {line}")),
                _ => self.progress.note(&format!("{file}: {line} ({count} times)")),
            }
        }
        match self.n_untold.get() {
            0 => {}
            n => self.progress.note(&format!("{file}: {n} more of such lines")),
        }
    }
}

fn spend(left: &Cell<u64>, n_bytes: u64) -> Option<()> {
    left.set(left.get().checked_sub(n_bytes)?);
    Some(())
}

fn too_large(json: &Json, n_bytes: u64) -> Error {
    let found = format!("{n_bytes} bytes more than once, or of zeros");
    json.error(found, "no more memory than a file of this size can need")
}
