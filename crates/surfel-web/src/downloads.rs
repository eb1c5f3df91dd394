//! Files of points and movies that pages have requested, until they are fetched or replaced.

use crate::lock::lock;
use crate::random_name::random_name;
use crate::scene_provider::{Result, WrittenFile};
use axum::body::{Body, Bytes};
use futures_util::stream;
use std::collections::HashMap;
use std::io::Read;
use std::sync::{Arc, Mutex};

/// Number of bytes that are read at once.
const CHUNK_BYTES: usize = 1 << 18;

/// The files of all pages, by random names.
#[derive(Default)]
pub struct Downloads(Mutex<HashMap<String, Arc<dyn WrittenFile>>>);

/// Removes a file when dropped; answers that are being read keep it until they end.
pub struct DownloadGuard {
    downloads: Arc<Downloads>,
    /// Name of the file.
    pub name: String,
}

impl Downloads {
    /// Keeps a file for as long as the returned guard lives.
    ///
    /// # Errors
    ///
    /// Fails if the system has no random numbers.
    pub fn add(self: &Arc<Self>, file: Arc<dyn WrittenFile>) -> Result<DownloadGuard> {
        let name = random_name()?;
        lock(&self.0).insert(name.clone(), file);
        Ok(DownloadGuard { downloads: self.clone(), name })
    }

    /// The file of this name, if it is kept.
    pub fn get(&self, name: &str) -> Option<Arc<dyn WrittenFile>> {
        lock(&self.0).get(name).cloned()
    }
}

impl Drop for DownloadGuard {
    fn drop(&mut self) {
        lock(&self.downloads.0).remove(&self.name);
    }
}

/// Reads a file piece by piece, as fast as the client does.
///
/// # Errors
///
/// Fails if the file cannot be opened.
pub fn body(file: &Arc<dyn WrittenFile>) -> std::io::Result<Body> {
    let (reader, held) = (file.open()?, file.clone());
    let pieces = stream::unfold((reader, held), async |(mut reader, held)| {
        let read = tokio::task::spawn_blocking(move || {
            let mut piece = vec![0; CHUNK_BYTES];
            let n_read = reader.read(&mut piece)?;
            piece.truncate(n_read);
            Ok((piece, reader))
        });
        match read.await.unwrap_or_else(|error| Err(std::io::Error::other(error))) {
            Ok((piece, _)) if piece.is_empty() => None,
            Ok((piece, reader)) => Some((Ok(Bytes::from(piece)), (reader, held))),
            Err(error) => {
                let ended: Box<dyn Read + Send> = Box::new(std::io::empty());
                Some((Err(error), (ended, held)))
            }
        }
    });
    Ok(Body::from_stream(pieces))
}
