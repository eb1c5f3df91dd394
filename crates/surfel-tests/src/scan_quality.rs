//! Pictures of scans compared with the scenes that were scanned, by kind of object.

use crate::picture_difference::PictureError;
use crate::true_scene::{TruePixel, TrueScene};
use surfel_core::image::{Aovs, Image};

/// Figures of one kind of object over all views.
#[derive(Clone, Debug, Default)]
pub struct KindQuality {
    /// The kind of object.
    pub kind: &'static str,
    /// Number of pixels that show a scanned part of it.
    pub n_pixels: usize,
    /// Scanned pixels that show points at about the true depth, as a fraction of all scanned ones.
    pub shown: f64,
    /// Scanned pixels that show points far off the true depth, as a fraction of all scanned ones.
    pub far_off: f64,
    /// Root mean square of the depth differences of shown pixels in metres.
    pub depth_rms: f64,
    /// Mean angle between the normals of shown pixels in degrees.
    pub normal_deg: f64,
    /// Mean difference of the covered fraction of blocks of 16 x 16 pixels that show the kind.
    pub block_coverage_error: f64,
    /// Peak signal-to-noise ratio of the lit picture in decibels, over scanned pixels.
    pub lit_psnr_db: f64,
}

/// Figures of all views of a scan.
#[derive(Clone, Debug, Default)]
pub struct ScanQuality {
    /// Pixels that show points but nothing in truth, as a fraction of the pixels that show nothing in truth; `None` if
    /// there are none.
    pub false_hits: Option<f64>,
    /// Figures by kind of object.
    pub kinds: Vec<KindQuality>,
}

/// Width and height of blocks in pixels.
const BLOCK_SIZE: usize = 16;

/// Compares the pictures of all views with the scene.
///
/// # Panics
///
/// Panics if a picture has no AOVs or another size than the views.
pub fn compare(scene: &TrueScene, images: &[Image]) -> ScanQuality {
    let mut tally = Tally::new(scene.kinds().len());
    for (pixels, image) in scene.views().zip(images) {
        tally.add_pixels(pixels, image);
        tally.add_blocks(pixels, image.aovs.as_ref().unwrap(), image.width as usize);
    }
    tally.quality(scene.kinds())
}

/// Sums over pixels of one kind.
#[derive(Clone, Default)]
struct KindTally {
    n_pixels: usize,
    n_shown: usize,
    n_far_off: usize,
    squares: f64,
    angles: f64,
    n_blocks: usize,
    block_errors: f64,
    lit: PictureError,
}

struct Tally {
    n_background: usize,
    n_false: usize,
    kinds: Vec<KindTally>,
}

impl Tally {
    fn new(n_kinds: usize) -> Self {
        Self { n_background: 0, n_false: 0, kinds: vec![KindTally::default(); n_kinds] }
    }

    fn add_pixels(&mut self, pixels: &[Option<TruePixel>], image: &Image) {
        let aovs = image.aovs.as_ref().unwrap();
        for (i, truth) in pixels.iter().enumerate() {
            let depth = f64::from(aovs.depth[i]);
            let Some(truth) = truth else {
                self.n_background += 1;
                self.n_false += usize::from(depth.is_finite());
                continue;
            };
            let kind = &mut self.kinds[truth.kind_idx];
            if !truth.is_scanned {
                continue;
            }
            kind.n_pixels += 1;
            kind.lit.add(image.color[i][0], truth.radiance);
            // Points at another depth than this show another object.
            let tolerance = 0.1 + 0.01 * truth.depth;
            let error = depth - truth.depth;
            if tolerance < error.abs() {
                kind.n_far_off += usize::from(depth.is_finite());
                continue;
            }
            kind.n_shown += 1;
            kind.squares += error * error;
            kind.angles += f64::from(aovs.normal[i].angle_between(truth.normal));
        }
    }

    /// Adds the error of each block to every kind that it shows.
    fn add_blocks(&mut self, pixels: &[Option<TruePixel>], aovs: &Aovs, width: usize) {
        let n_blocks = width / BLOCK_SIZE;
        for block in 0..n_blocks * n_blocks {
            let corner = (block / n_blocks * width + block % n_blocks) * BLOCK_SIZE;
            let inside = (0..BLOCK_SIZE * BLOCK_SIZE)
                .map(|i| corner + i / BLOCK_SIZE * width + i % BLOCK_SIZE);
            let n_true = inside.clone().filter(|i| pixels[*i].is_some()).count() as f64;
            let n_shown = inside.clone().filter(|i| aovs.depth[*i].is_finite()).count() as f64;
            let error = (n_true - n_shown).abs() / (BLOCK_SIZE * BLOCK_SIZE) as f64;
            for (kind_idx, kind) in self.kinds.iter_mut().enumerate() {
                let shows = |i: usize| {
                    pixels[i].is_some_and(|pixel| pixel.kind_idx == kind_idx && pixel.is_scanned)
                };
                if inside.clone().any(shows) {
                    kind.n_blocks += 1;
                    kind.block_errors += error;
                }
            }
        }
    }

    fn quality(&self, names: &[&'static str]) -> ScanQuality {
        let quality = |(name, tally): (&&'static str, &KindTally)| KindQuality {
            kind: name,
            n_pixels: tally.n_pixels,
            shown: tally.n_shown as f64 / tally.n_pixels as f64,
            far_off: tally.n_far_off as f64 / tally.n_pixels as f64,
            depth_rms: (tally.squares / tally.n_shown as f64).sqrt(),
            normal_deg: (tally.angles / tally.n_shown as f64).to_degrees(),
            block_coverage_error: tally.block_errors / tally.n_blocks as f64,
            lit_psnr_db: tally.lit.psnr_db(),
        };
        ScanQuality {
            false_hits: (0 < self.n_background)
                .then(|| self.n_false as f64 / self.n_background as f64),
            kinds: names.iter().zip(&self.kinds).map(quality).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    //! Figures of pictures that differ from the scene by known amounts.

    use super::*;
    use surfel_core::math::Vec3;

    const RESOLUTION: usize = 32;

    /// Returns pixels whose left half shows the first kind, a wall 10 m away.
    fn pixels() -> Vec<Option<TruePixel>> {
        let wall = TruePixel {
            kind_idx: 0,
            depth: 10.0,
            normal: Vec3::X,
            is_scanned: true,
            radiance: 1.0,
        };
        let is_left = |i: usize| i % RESOLUTION < RESOLUTION / 2;
        (0..RESOLUTION * RESOLUTION).map(|i| is_left(i).then_some(wall)).collect()
    }

    /// Returns a picture of these depths, white where they are finite.
    fn image(depth: impl Fn(usize) -> f32) -> Image {
        let size = RESOLUTION as u32;
        let mut image = Image::with_aovs(size, size);
        let aovs = image.aovs.as_mut().unwrap();
        for (i, found) in aovs.depth.iter_mut().enumerate() {
            *found = depth(i);
            image.color[i] = [f32::from(u8::from(found.is_finite())); 4];
        }
        aovs.normal.fill(Vec3::Y);
        image
    }

    fn quality(image: &Image) -> ScanQuality {
        let mut tally = Tally::new(1);
        tally.add_pixels(&pixels(), image);
        tally.add_blocks(&pixels(), image.aovs.as_ref().unwrap(), RESOLUTION);
        tally.quality(&["wall"])
    }

    #[test]
    fn a_wall_that_covers_everything_is_false_on_the_other_half() {
        let quality = quality(&image(|_| 10.05));
        assert_eq!(quality.false_hits, Some(1.0));
        let wall = &quality.kinds[0];
        assert_eq!((wall.shown, wall.far_off, wall.block_coverage_error), (1.0, 0.0, 0.0));
        assert!((wall.depth_rms - 0.05).abs() < 1e-5 && (wall.normal_deg - 90.0).abs() < 1e-3);
    }

    #[test]
    fn every_second_row_missing_is_half_the_coverage() {
        let quality = quality(&image(|i| {
            let is_shown = (i / RESOLUTION).is_multiple_of(2) && i % RESOLUTION < RESOLUTION / 2;
            if is_shown { 10.0 } else { f32::INFINITY }
        }));
        let wall = &quality.kinds[0];
        assert_eq!(quality.false_hits, Some(0.0));
        assert_eq!((wall.shown, wall.block_coverage_error), (0.5, 0.5));
        // Half of the squares are 1.
        assert!((wall.lit_psnr_db - 10.0 * 2f64.log10()).abs() < 1e-6, "{wall:?}");
    }

    #[test]
    fn depths_of_other_objects_are_far_off() {
        let wall = &quality(&image(|_| 12.0)).kinds[0];
        assert_eq!((wall.shown, wall.far_off), (0.0, 1.0));
    }
}
