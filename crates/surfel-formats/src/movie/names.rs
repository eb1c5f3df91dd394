//! Where the pictures of the frames are.

use std::path::{Path, PathBuf};

/// The names of the frames' pictures: a number between two pieces of text.
#[derive(Clone, Debug)]
pub(super) struct FrameNames {
    pub folder: PathBuf,
    before: String,
    n_digits: usize,
    after: String,
}

impl FrameNames {
    /// `frame_####.png`: the last run of `#` stands for the number, as it does in Blender.
    ///
    /// None where there is no `#`, or where the name is not Unicode.
    pub fn numbered(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let end = name.rfind('#')? + 1;
        let before = name[..end].trim_end_matches('#');
        Some(Self {
            folder: path.parent()?.to_owned(),
            before: before.into(),
            n_digits: end - before.len(),
            after: name[end..].into(),
        })
    }

    /// `000001.png` in a folder beside the film, `film.mp4.frames`.
    pub fn beside(path: &Path) -> Self {
        let mut folder = path.file_name().unwrap_or_default().to_owned();
        folder.push(".frames");
        let folder = path.with_file_name(folder);
        Self { folder, before: String::new(), n_digits: 6, after: ".png".into() }
    }

    /// The picture of a frame that is counted from 0; the names count from 1.
    pub fn path(&self, frame: u32) -> PathBuf {
        let Self { before, n_digits, after, .. } = self;
        let number = u64::from(frame) + 1;
        self.folder.join(format!("{before}{number:0n_digits$}{after}"))
    }

    /// Whether some frame's picture has this name.
    pub fn fits(&self, name: &str) -> bool {
        let number = name.strip_prefix(&self.before).and_then(|n| n.strip_suffix(&self.after));
        number.is_some_and(|n| self.n_digits <= n.len() && n.bytes().all(|b| b.is_ascii_digit()))
    }
}
