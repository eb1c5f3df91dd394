//! Plans and elevations to scale: pictures without perspective whose pixels have a known size.

use super::Invalid;
use super::keys::settings;
use super::picture::OutputPath;
use super::rule::{POSITIVE, Rule, as_number, expected, number};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

settings! {
    /// Plans and elevations to scale.
    pub struct PlanSettings {
        /// Renders a plan whose pixels are this many world units wide (ground sample distance), as in 0.05. It looks
        /// straight down unless the camera has a direction, and shows the whole scene unless --resolution gives the size
        /// of a sheet about --camera-focal-point. Pixels lie on multiples of the width, so that sheets tile. A .tif is a
        /// GeoTIFF; .png, .jpg and .webp get a world file.
        gsd: f64, POSITIVE, "LENGTH";
        /// Renders a plan to scale for a print with --dpi, as in 1:50, in the unit of the coordinate system or in metres.
        scale: f64, ScaleRule, "1:N";
        /// Pixels per inch of the print, also written to PNG, JPEG and TIFF.
        dpi: f64 = 300.0, number(1.0, 10_000.0), "N";
        /// Writes the elevations of a plan as a GeoTIFF of 32-bit numbers too; -9999 where nothing is.
        height_map: PathBuf, OutputPath, "FILE";
    }
}

impl PlanSettings {
    /// Returns true if the picture is to scale.
    pub fn is_to_scale(&self) -> bool {
        self.gsd.is_some() || self.scale.is_some()
    }

    /// Returns the side of a pixel in world units, if the picture is to scale, for a unit of so many metres.
    pub fn pixel_size(&self, metres_per_unit: f64) -> Option<f64> {
        const METRES_PER_INCH: f64 = 0.0254;
        let printed = METRES_PER_INCH / self.dpi();
        self.gsd.or_else(|| Some(self.scale? * printed / metres_per_unit))
    }

    /// Returns the pixels per inch that a picture states.
    pub fn stated_dpi(&self) -> Option<f64> {
        self.dpi.or_else(|| self.scale.map(|_| self.dpi()))
    }
}

/// A scale as in `1:50`, or the number after the colon.
struct ScaleRule;

impl Rule<f64> for ScaleRule {
    fn read(&self, value: &Value, _: &Path) -> Result<f64, Invalid> {
        let number = match value.as_str().and_then(|text| text.split_once(':')) {
            Some((one, number)) => {
                let parse = |text: &str| text.trim().parse::<f64>().ok();
                parse(number).zip(parse(one)).map(|(number, one)| number / one)
            }
            None => as_number(value),
        };
        number
            .filter(|number| (1e-6..1e9).contains(number))
            .ok_or_else(|| expected("a scale as in 1:50"))
    }

    fn write(&self, value: &f64) -> Value {
        json!(format!("1:{value}"))
    }
}

#[cfg(test)]
mod tests {
    //! Scales and the pixels that they make.

    use super::*;

    #[test]
    fn a_scale_is_a_ratio_on_paper() {
        let read = |text: &str| ScaleRule.read(&json!(text), Path::new("")).ok();
        assert_eq!((read("1:50"), read("2:1"), read("200")), (Some(50.0), Some(0.5), Some(200.0)));
        for wrong in ["", "1:0", "0:1", "1:x", "-1:50", "1:1e400", "NaN"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
        assert_eq!(ScaleRule.write(&50.0), json!("1:50"));
    }

    #[test]
    fn pixels_follow_from_scale_resolution_and_unit() {
        let plan = PlanSettings { scale: Some(50.0), dpi: Some(254.0), ..Default::default() };
        // At 254 pixels per inch a pixel is 0.1 mm on paper.
        assert!((plan.pixel_size(1.0).unwrap() - 0.005).abs() < 1e-12);
        assert!((plan.pixel_size(0.3048).unwrap() - 0.005 / 0.3048).abs() < 1e-12);
        assert_eq!(PlanSettings::default().pixel_size(1.0), None);
        assert_eq!((plan.stated_dpi(), PlanSettings::default().stated_dpi()), (Some(254.0), None));
    }
}
