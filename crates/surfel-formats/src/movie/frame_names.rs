//! File names of the frame images.

use std::path::{Path, PathBuf};

/// A folder and a file name pattern: a frame number between a prefix and a suffix.
#[derive(Clone, Debug)]
pub(super) struct FrameNames {
    /// Folder of the frames.
    pub folder: PathBuf,
    prefix: String,
    n_digits: usize,
    suffix: String,
}

impl FrameNames {
    /// Parses a pattern such as `frame_####.png`: the last run of `#` stands for the number, as in Blender.
    ///
    /// Returns `None` if there is no `#` or if the name is not Unicode.
    pub fn from_pattern(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let end = name.rfind('#')? + 1;
        let prefix = name[..end].trim_end_matches('#');
        Some(Self {
            folder: path.parent()?.to_owned(),
            prefix: prefix.into(),
            n_digits: end - prefix.len(),
            suffix: name[end..].into(),
        })
    }

    /// Names frames `000001.png` and so on in the folder `NAME.frames` next to the movie `NAME`.
    pub fn in_frames_folder(path: &Path) -> Self {
        let mut folder = path.file_name().unwrap_or_default().to_owned();
        folder.push(".frames");
        let folder = path.with_file_name(folder);
        Self { folder, prefix: String::new(), n_digits: 6, suffix: ".png".into() }
    }

    /// Returns the path of a frame's image. Frame indices start at 0, the numbers in names at 1.
    pub fn path(&self, frame: u32) -> PathBuf {
        let Self { prefix, n_digits, suffix, .. } = self;
        let number = u64::from(frame) + 1;
        self.folder.join(format!("{prefix}{number:0n_digits$}{suffix}"))
    }

    /// Returns true if `name` follows the pattern.
    pub fn matches(&self, name: &str) -> bool {
        let number = name.strip_prefix(&self.prefix).and_then(|n| n.strip_suffix(&self.suffix));
        number.is_some_and(|n| self.n_digits <= n.len() && n.bytes().all(|b| b.is_ascii_digit()))
    }
}
