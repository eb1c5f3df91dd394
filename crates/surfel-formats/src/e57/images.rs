//! The pictures that a file holds beside its points, as its XML describes them.

use e57::{Image, Projection};
use surfel_core::math::DVec3;

use super::document::Document;
use super::scan::scan_name;
use crate::options::{EmbeddedImage, ImageCamera};

/// Returns the pictures of a file that have data, in its order.
pub(super) fn embedded_images(document: &Document) -> Vec<EmbeddedImage> {
    let images = document.images.iter().enumerate();
    images.filter_map(|(i, image)| embedded_image(i, image, document)).collect()
}

/// Returns the `index`-th picture. Its projection tells more than the visual reference that it may have besides.
fn embedded_image(index: usize, image: &Image, document: &Document) -> Option<EmbeddedImage> {
    let (camera, width, height, blob) = match (&image.projection, &image.visual_reference) {
        (Some(Projection::Pinhole(it)), _) => {
            (ImageCamera::Pinhole, it.properties.width, it.properties.height, &it.blob)
        }
        (Some(Projection::Spherical(it)), _) => {
            (ImageCamera::Spherical, it.properties.width, it.properties.height, &it.blob)
        }
        (Some(Projection::Cylindrical(it)), _) => {
            (ImageCamera::Cylindrical, it.properties.width, it.properties.height, &it.blob)
        }
        (None, Some(it)) => {
            (ImageCamera::VisualReference, it.properties.width, it.properties.height, &it.blob)
        }
        (None, None) => return None,
    };
    let name = image.name.clone().filter(|name| !name.trim().is_empty());
    let of_image = |guid: &Option<String>| guid.is_some() && *guid == image.pointcloud_guid;
    let scan = document.scans.iter().position(|scan| of_image(&scan.guid));
    let translation = image.transform.as_ref().map(|pose| &pose.translation);
    Some(EmbeddedImage {
        name: name.unwrap_or_else(|| format!("image {}", index + 1)),
        camera,
        width,
        height,
        n_bytes: blob.data.length,
        position: translation.map(|t| DVec3::new(t.x, t.y, t.z)),
        scan: scan.map(|scan| scan_name(scan, &document.scans[scan])),
    })
}
