//! Files that pages add to their views: the memory that they may take, and their bytes on the way to the server.

use crate::limits::Limits;
use crate::lock::lock;
use crate::random_name::random_name;
use crate::scene_provider::{AddedFile, Error, Result};
use axum::body::Body;
use futures_util::StreamExt;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::time::timeout;

/// Least number of bytes a second, on the whole, with which a file must arrive.
const MIN_BYTES_PER_SEC: u64 = 1 << 14;
/// Maximum number of characters of a file's name.
const MAX_NAME_LENGTH: usize = 255;

/// The uploads that are expected from all pages, by random names, and the memory of all added files.
pub struct FileUploads {
    expected: Mutex<HashMap<String, Upload>>,
    n_reserved: Mutex<u64>,
    max_file_bytes: u64,
    max_bytes: u64,
}

/// The bytes of a file that a page has announced.
struct Upload {
    n_bytes: u64,
    sender: oneshot::Sender<Vec<u8>>,
}

/// The place of an upload, which is given up when this is dropped.
pub struct UploadGuard {
    uploads: Arc<FileUploads>,
    /// Name of the upload.
    pub name: String,
    /// Receives the bytes once all have arrived.
    pub receiver: oneshot::Receiver<Vec<u8>>,
}

/// Memory that is reserved until this is dropped.
pub struct Reservation {
    uploads: Arc<FileUploads>,
    n_bytes: u64,
}

/// The reason why the bytes of a file were not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadError {
    /// Nobody expects an upload of this name, or nobody does any more.
    Unexpected,
    /// There are more bytes than announced.
    TooLarge,
    /// There are fewer bytes than announced.
    TooSmall,
    /// The bytes arrive too slowly.
    TooSlow,
}

impl FileUploads {
    /// No uploads, and no memory in use.
    pub fn new(limits: &Limits) -> Self {
        Self {
            expected: Mutex::default(),
            n_reserved: Mutex::new(0),
            max_file_bytes: limits.max_added_file_bytes,
            max_bytes: limits.max_added_bytes,
        }
    }

    /// Reserves memory for a file.
    ///
    /// # Errors
    ///
    /// Fails for a file without bytes or with a name that is none, for one beyond the limit, and if those of other pages
    /// leave too little.
    pub fn reserve(self: &Arc<Self>, name: &str, n_bytes: u64) -> Result<Reservation> {
        if !(1..=MAX_NAME_LENGTH).contains(&name.chars().count()) {
            let text = format!("a file needs a name of 1 to {MAX_NAME_LENGTH} characters");
            return Err(Error::invalid_request(text));
        }
        if n_bytes == 0 {
            return Err(Error::invalid_request(format!("{name} is empty")));
        }
        let mut reservation = Reservation { uploads: self.clone(), n_bytes: 0 };
        reservation.resize(name, n_bytes)?;
        Ok(reservation)
    }

    /// Expects the bytes of a file under a random name.
    ///
    /// # Errors
    ///
    /// Fails if the system has no random numbers.
    pub fn expect(self: &Arc<Self>, n_bytes: u64) -> Result<UploadGuard> {
        let name = random_name()?;
        let (sender, receiver) = oneshot::channel();
        lock(&self.expected).insert(name.clone(), Upload { n_bytes, sender });
        Ok(UploadGuard { uploads: self.clone(), name, receiver })
    }

    /// Takes the bytes of an upload; each piece must arrive within `patience`.
    ///
    /// # Errors
    ///
    /// Fails for names that are not expected, for other numbers of bytes than announced, and for slow clients.
    pub async fn take(
        &self,
        name: &str,
        body: Body,
        patience: Duration,
    ) -> std::result::Result<(), UploadError> {
        // A name counts once.
        let upload = lock(&self.expected).remove(name);
        let Upload { n_bytes, sender } = upload.ok_or(UploadError::Unexpected)?;
        let end = Instant::now() + patience + Duration::from_secs(n_bytes / MIN_BYTES_PER_SEC);
        let mut pieces = body.into_data_stream();
        let mut bytes = Vec::new();
        loop {
            let patience = patience.min(end.saturating_duration_since(Instant::now()));
            let piece = timeout(patience, pieces.next()).await;
            let Some(piece) = piece.map_err(|_| UploadError::TooSlow)? else { break };
            // The client has gone.
            let piece = piece.map_err(|_| UploadError::TooSmall)?;
            if n_bytes < (bytes.len() + piece.len()) as u64 {
                return Err(UploadError::TooLarge);
            }
            if sender.is_closed() {
                return Err(UploadError::Unexpected);
            }
            bytes.extend_from_slice(&piece);
        }
        if (bytes.len() as u64) < n_bytes {
            return Err(UploadError::TooSmall);
        }
        sender.send(bytes).map_err(|_| UploadError::Unexpected)
    }
}

impl UploadGuard {
    /// Returns true until the bytes begin to arrive.
    pub fn is_awaited(&self) -> bool {
        lock(&self.uploads.expected).contains_key(&self.name)
    }
}

impl Drop for UploadGuard {
    fn drop(&mut self) {
        lock(&self.uploads.expected).remove(&self.name);
    }
}

impl Reservation {
    /// Reserves another number of bytes instead.
    ///
    /// # Errors
    ///
    /// Fails beyond the limits; the reservation then stays as it was.
    pub fn resize(&mut self, name: &str, n_bytes: u64) -> Result<()> {
        let max_file = self.uploads.max_file_bytes;
        if max_file < n_bytes {
            let (found, limit) = (mebibytes(n_bytes), mebibytes(max_file));
            let text = format!("{name} takes {found}, expected at most {limit}");
            return Err(Error::invalid_request(text));
        }
        self.set(name, n_bytes)
    }

    /// Reserves memory for the content of a file beside that for its bytes.
    ///
    /// # Errors
    ///
    /// Fails if the files of all pages leave too little; the reservation then stays as it was.
    pub fn add_content(&mut self, name: &str, n_bytes: u64) -> Result<()> {
        // Content beyond the limit is refused with the reason when it is read.
        self.set(name, self.n_bytes + n_bytes.min(self.uploads.max_file_bytes))
    }

    fn set(&mut self, name: &str, n_bytes: u64) -> Result<()> {
        let max_all = self.uploads.max_bytes;
        let mut n_reserved = lock(&self.uploads.n_reserved);
        let n_others = *n_reserved - self.n_bytes;
        if max_all < n_others + n_bytes {
            let (found, left) = (mebibytes(n_bytes), mebibytes(max_all - n_others));
            let text = format!(
                "{name} takes {found}, and files that were added before leave {left}; \
                 they are kept until their pages are closed"
            );
            return Err(Error::invalid_request(text));
        }
        *n_reserved = n_others + n_bytes;
        self.n_bytes = n_bytes;
        Ok(())
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        *lock(&self.uploads.n_reserved) -= self.n_bytes;
    }
}

/// The files that one page has added. They are kept until it goes, so that their removal can be undone.
#[derive(Default)]
pub struct PageFiles {
    kept: Mutex<Vec<(Arc<dyn AddedFile>, Reservation)>>,
    /// Held while a file is read and kept.
    pub turn: tokio::sync::Mutex<()>,
}

impl PageFiles {
    /// Returns the names of the files.
    ///
    /// # Errors
    ///
    /// Fails if there are `max_files`.
    pub fn names_if_below(&self, max_files: usize) -> Result<Vec<String>> {
        let kept = lock(&self.kept);
        if max_files <= kept.len() {
            let text = format!("a page can add {max_files} files; those that it removes count too");
            return Err(Error::invalid_request(text));
        }
        Ok(kept.iter().map(|(file, _)| file.name().to_owned()).collect())
    }

    /// Keeps a file and its memory.
    pub fn keep(&self, file: Arc<dyn AddedFile>, reservation: Reservation) {
        lock(&self.kept).push((file, reservation));
    }
}

fn mebibytes(n_bytes: u64) -> String {
    const MEBIBYTE: f64 = (1 << 20) as f64;
    match n_bytes as f64 / MEBIBYTE {
        few if few < 10.0 => format!("{few:.1} MiB"),
        many => format!("{many:.0} MiB"),
    }
}

#[cfg(test)]
mod tests {
    //! Memory is reserved up to the limits, and given back.

    use super::*;

    fn uploads() -> Arc<FileUploads> {
        let limits =
            Limits { max_added_file_bytes: 100, max_added_bytes: 250, ..Limits::default() };
        Arc::new(FileUploads::new(&limits))
    }

    #[test]
    fn files_beyond_the_limits_are_refused() {
        let uploads = uploads();
        assert!(uploads.reserve("a", 101).is_err());
        assert!(uploads.reserve("a", 0).is_err());
        assert!(uploads.reserve("", 1).is_err());
        assert!(uploads.reserve(&"a".repeat(MAX_NAME_LENGTH + 1), 1).is_err());
        let first = uploads.reserve("a", 100).unwrap();
        let mut second = uploads.reserve("b", 100).unwrap();
        assert!(uploads.reserve("c", 51).is_err());
        let third = uploads.reserve("c", 50).unwrap();
        assert!(second.resize("b", 101).is_err());
        second.resize("b", 20).unwrap();
        assert!(uploads.reserve("d", 81).is_err());
        assert!(second.add_content("b", 81).is_err());
        second.add_content("b", 60).unwrap();
        assert!(uploads.reserve("d", 21).is_err());
        drop((first, second, third));
        assert_eq!(*lock(&uploads.n_reserved), 0);
    }

    #[tokio::test]
    async fn the_announced_number_of_bytes_arrives_once() {
        let (uploads, patience) = (uploads(), Duration::from_secs(5));
        let guard = uploads.expect(3).unwrap();
        assert_eq!(uploads.take("x", Body::empty(), patience).await, Err(UploadError::Unexpected));
        assert_eq!(uploads.take(&guard.name, Body::from("abc"), patience).await, Ok(()));
        let again = uploads.take(&guard.name, Body::from("abc"), patience).await;
        assert_eq!(again, Err(UploadError::Unexpected));
        for (body, error) in [("ab", UploadError::TooSmall), ("abcd", UploadError::TooLarge)] {
            let guard = uploads.expect(3).unwrap();
            let taken = uploads.take(&guard.name, Body::from(body), patience).await;
            assert_eq!(taken, Err(error));
        }
        let given_up = uploads.expect(3).unwrap().name.clone();
        let taken = uploads.take(&given_up, Body::from("abc"), patience).await;
        assert_eq!(taken, Err(UploadError::Unexpected));
    }
}
