//! State shared by all parts of the reader: the JSON, the buffers, a memory budget and collected warnings.

use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::PathBuf;
use std::rc::Rc;

use surfel_core::words::counted;

use surfel_core::progress::Progress;

use super::json::Json;
use super::uri::{BufferData, file_path, is_data_uri, open_file, read_data_uri};
use crate::error::{Error, Result};
use crate::file::{Input, ResourceResolver, file_key};

/// Decoded bytes allowed for a file of any size: accessors without a buffer are zeros and take no space in
/// the file.
const BASE_BYTES: u64 = 64 << 20;
/// Decoded bytes allowed per byte of the file: several meshes may share vertices.
const BYTES_PER_BYTE: u64 = 64;

/// Maximum number of different warnings that are reported.
const MAX_WARNINGS: usize = 20;

/// An open glTF file.
pub(super) struct Document<'a> {
    /// The root of the JSON.
    pub root: Json<'a>,
    /// Finds the files that the document names.
    pub resolver: &'a ResourceResolver<'a>,
    /// Receives warnings, and cancels.
    pub progress: &'a dyn Progress,
    buffers: &'a [Buffer<'a>],
    memory_budget: Cell<u64>,
    image_budget: Cell<u64>,
    /// Distinct warnings and how often each occurred.
    warnings: RefCell<Vec<(String, usize)>>,
    /// Number of warnings beyond [`MAX_WARNINGS`].
    n_suppressed: Cell<usize>,
}

/// A buffer. Its data is absent if an extension would have to provide it.
pub(super) struct Buffer<'a> {
    data: Option<BufferData<'a>>,
    n_bytes: usize,
}

/// The buffers of a file.
pub(super) struct Buffers<'a> {
    all: Vec<Buffer<'a>>,
    /// Bytes of `data:` URIs and of external files, each file once.
    n_external_bytes: usize,
}

/// A range of a buffer.
#[derive(Clone, Copy)]
pub(super) struct BufferView<'a> {
    /// The bytes of the view.
    pub bytes: &'a [u8],
    /// Distance in bytes between consecutive elements, if the file declares it.
    pub stride: Option<usize>,
}

/// Loads the data of all buffers.
pub(super) fn load_buffers<'a>(
    root: &Json<'a>,
    bin_chunk: Option<&'a [u8]>,
    resolver: &ResourceResolver,
) -> Result<Buffers<'a>> {
    let mut files: HashMap<PathBuf, Rc<Input>> = HashMap::new();
    let mut buffers = Buffers { all: Vec::new(), n_external_bytes: 0 };
    for (i, buffer) in root.array_or_empty("buffers")?.into_iter().enumerate() {
        let length = buffer.require("byteLength")?;
        let data = match buffer.get("uri") {
            Some(uri) if is_data_uri(uri.string()?) => {
                let bytes = read_data_uri(&uri)?;
                buffers.n_external_bytes += bytes.len();
                Some(BufferData::DataUri(bytes))
            }
            Some(uri) => {
                let path = file_path(resolver, &uri)?;
                let file = match files.entry(file_key(&path)) {
                    Entry::Occupied(known) => known.get().clone(),
                    Entry::Vacant(vacant) => {
                        let file = open_file(&path, &uri)?;
                        buffers.n_external_bytes += file.len();
                        vacant.insert(Rc::new(file)).clone()
                    }
                };
                Some(BufferData::File(file))
            }
            None if i == 0 => bin_chunk.map(BufferData::BinChunk),
            None => None,
        };
        let n_bytes = length.index()?;
        if let Some(data) = &data
            && data.len() < n_bytes
        {
            let found = format!("{n_bytes}, but the buffer has {}", counted(data.len(), "byte"));
            return Err(length.error(found, "no more bytes than there are"));
        }
        buffers.all.push(Buffer { data, n_bytes });
    }
    Ok(buffers)
}

impl<'a> Document<'a> {
    /// Wraps a file of `n_bytes` and its buffers.
    pub fn new(
        root: Json<'a>,
        buffers: &'a Buffers<'a>,
        n_bytes: usize,
        resolver: &'a ResourceResolver<'a>,
        progress: &'a dyn Progress,
    ) -> Self {
        // The buffer of a GLB is already counted as a part of the file.
        let n_bytes = (n_bytes + buffers.n_external_bytes) as u64;
        Self {
            root,
            resolver,
            progress,
            buffers: &buffers.all,
            memory_budget: Cell::new(BASE_BYTES + BYTES_PER_BYTE.saturating_mul(n_bytes)),
            image_budget: Cell::new(n_bytes),
            warnings: RefCell::default(),
            n_suppressed: Cell::new(0),
        }
    }

    /// Returns the object at the index `reference` in a top-level array of the file.
    pub fn resolve(&self, array: &str, reference: &Json<'a>) -> Result<Json<'a>> {
        self.root.resolve(array, reference)
    }

    /// Returns the buffer view at the index `reference`.
    pub fn view(&self, reference: &Json<'a>) -> Result<BufferView<'a>> {
        let view = self.resolve("bufferViews", reference)?;
        let buffer = view.require("buffer")?;
        self.resolve("buffers", &buffer)?;
        let Some(Buffer { data, n_bytes }) = self.buffers.get(buffer.index()?) else {
            return Err(buffer.type_error("a buffer"));
        };
        let Some(data) = data else {
            return Err(buffer.error("a buffer without `uri`", "a buffer with data"));
        };
        let (offset, length) = (view.unsigned_or("byteOffset", 0)?, view.require("byteLength")?);
        let end = offset.checked_add(length.unsigned()?).filter(|end| *end <= *n_bytes as u64);
        let Some(end) = end else {
            let found = format!("{} from byte {offset}", counted(length.unsigned()?, "byte"));
            return Err(
                view.error(found, format!("a part of the buffer's {}", counted(*n_bytes, "byte")))
            );
        };
        let stride = view.get("byteStride").map(|stride| stride.index()).transpose()?;
        Ok(BufferView { bytes: &data[offset as usize..end as usize], stride })
    }

    /// Reserves memory from the budget before it is allocated for `json`. Without the budget, a small file
    /// could demand any amount of memory by references to the same bytes.
    pub fn reserve(&self, json: &Json, n_elements: usize, bytes_each: usize) -> Result<()> {
        let n_bytes = (n_elements as u64).saturating_mul(bytes_each as u64);
        subtract(&self.memory_budget, n_bytes).ok_or_else(|| too_large(json, n_bytes))
    }

    /// Reserves the encoded bytes of an image. Decoded images are much larger than their files, so each byte of
    /// the file may be decoded only once.
    pub fn reserve_image(&self, json: &Json, n_bytes: usize) -> Result<()> {
        subtract(&self.image_budget, n_bytes as u64).ok_or_else(|| too_large(json, n_bytes as u64))
    }

    /// Adds a warning, which [`Self::flush_warnings`] reports. Equal warnings are counted.
    pub fn warn(&self, line: impl Into<String>) {
        let line = line.into();
        let mut notes = self.warnings.borrow_mut();
        let is_at_limit = MAX_WARNINGS <= notes.len();
        match notes.iter_mut().find(|(known, _)| *known == line) {
            Some((_, count)) => *count += 1,
            // A file with many different defects must not flood the output.
            None if is_at_limit => self.n_suppressed.set(self.n_suppressed.get() + 1),
            None => notes.push((line, 1)),
        }
    }

    /// Reports the collected warnings.
    pub fn flush_warnings(&self) {
        let file = self.root.file();
        for (line, count) in self.warnings.borrow().iter() {
            match count {
                1 => self.progress.note(&format!("{file}: {line}")),
                _ => self.progress.note(&format!("{file}: {line} ({count} times)")),
            }
        }
        match self.n_suppressed.get() {
            0 => {}
            n => self.progress.note(&format!("{file}: {}", counted(n, "more warning"))),
        }
    }
}

/// Subtracts from a budget; `None` if it is exhausted.
fn subtract(budget: &Cell<u64>, n_bytes: u64) -> Option<()> {
    budget.set(budget.get().checked_sub(n_bytes)?);
    Some(())
}

fn too_large(json: &Json, n_bytes: u64) -> Error {
    let found = format!("{n_bytes} bytes more than once, or of zeros");
    json.error(found, "no more memory than a file of this size can need")
}
