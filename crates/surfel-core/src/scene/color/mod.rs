//! Colours of points from one of the cloud's columns, which is chosen from the data if none is named.

mod source;
mod choose;
mod support;
mod coloring;
mod gamma;
mod mapping;
mod labels;
mod legend;

pub use choose::choose_source;
pub use coloring::Coloring;
pub use legend::{Legend, LegendClass, legend};
pub use mapping::common_range;
pub use source::{ColorSource, parse_hex};
pub use support::SupportColors;

use crate::error::Result;
use crate::image::class_color;
use crate::points::{PointCloud, to_8_bits};
use crate::progress::Progress;
use gamma::Gamma;
use labels::labels;
use mapping::Mapping;
use rayon::prelude::*;

/// Returns one sRGB-encoded colour for each point. `progress` receives a note about the chosen source and
/// range.
///
/// # Errors
///
/// Fails if `cloud` lacks the column that the colours show, or once the work is cancelled.
pub fn colorize(
    cloud: &PointCloud,
    coloring: &Coloring,
    progress: &dyn Progress,
) -> Result<Vec<[u8; 3]>> {
    let (source, reason) = coloring.source_for(cloud);
    // The note about intensity comes with its range below.
    if let Some(reason) = reason.filter(|_| source != ColorSource::Intensity) {
        progress.note(&format!("color {source}: {reason}"));
    }
    progress.check()?;
    let missing = || source.missing_from(cloud);
    let for_all = |color: &(dyn Fn(usize) -> [u8; 3] + Sync)| {
        (0..cloud.len()).into_par_iter().map(color).collect()
    };
    match &source {
        ColorSource::Rgb => {
            let colors = cloud.colors.as_ref().ok_or_else(missing)?;
            let strongest = |i: usize| to_unit(colors[i].into_iter().max().unwrap_or(0));
            let gamma = Gamma::new(coloring.gamma, colors.len(), strongest);
            let Some(described) = gamma.described() else {
                return Ok(for_all(&|i| colors[i].map(to_8_bits)));
            };
            if coloring.gamma.is_none() {
                progress.note(&format!("{described}: the colours of the file are dark"));
            }
            let brightened = |value: u16| (255.0 * gamma.apply(to_unit(value))).round() as u8;
            Ok(for_all(&|i| colors[i].map(brightened)))
        }
        ColorSource::Class => {
            let classes = cloud.classification.as_ref().ok_or_else(missing)?;
            Ok(for_all(&|i| class_color(classes[i])))
        }
        ColorSource::Normal => {
            let normals = cloud.normals.as_ref().ok_or_else(missing)?;
            Ok(for_all(&|i| (0.5 * normals[i] + 0.5).to_array().map(|x| (x * 255.0).round() as u8)))
        }
        ColorSource::Constant(color) => Ok(vec![*color; cloud.len()]),
        ColorSource::Intensity
        | ColorSource::Elevation
        | ColorSource::Support
        | ColorSource::Column(_) => {
            if let Some(values) = labels(cloud, coloring, &source) {
                progress.note(&format!("color {source}: each number has a colour of its own"));
                return Ok(for_all(&|i| labels::color_of(values.get(i))));
            }
            let mapping = Mapping::new(cloud, coloring, &source)?;
            progress.note(&format!("color {source} {}", mapping.description()));
            Ok(for_all(&|i| mapping.color((mapping.value_at)(i))))
        }
    }
}

/// Returns a 16-bit channel as a fraction of its maximum.
fn to_unit(value: u16) -> f32 {
    f32::from(value) / f32::from(u16::MAX)
}

#[cfg(test)]
mod tests {
    //! Colours come from the right column, through the right map.

    use super::*;
    use crate::image::{Colormap, label_color};
    use crate::math::Vec3;
    use crate::points::{Scalar, Values};
    use crate::progress::NoProgress;
    use std::sync::Mutex;

    struct Listener(Mutex<Vec<String>>);

    impl Progress for Listener {
        fn note(&self, line: &str) {
            self.0.lock().unwrap().push(line.to_owned());
        }
    }

    fn coloring(source: Option<&str>) -> Coloring {
        Coloring { source: source.map(|text| text.parse().unwrap()), ..Coloring::default() }
    }

    fn lattice() -> PointCloud {
        let position = |i: usize| Vec3::new((i % 50) as f32, (i / 50) as f32, i as f32);
        PointCloud::from_positions((0..2500).map(position).collect())
    }

    #[test]
    fn eight_bit_colors_survive_16_bit_columns() {
        let colors = (0..=255u16).map(|v| [257 * v; 3]).collect();
        let cloud = PointCloud {
            colors: Some(colors),
            ..PointCloud::from_positions(vec![Vec3::ZERO; 256])
        };
        let found = colorize(&cloud, &coloring(None), &NoProgress).unwrap();
        assert!(found.iter().enumerate().all(|(v, color)| *color == [v as u8; 3]));
    }

    #[test]
    fn dark_colors_are_brightened_unless_a_gamma_is_given() {
        let colors = Some(vec![[0x1010, 0x0808, 0]; 2500]);
        let cloud = PointCloud { colors, ..lattice() };
        let listener = Listener(Mutex::default());
        let found = colorize(&cloud, &coloring(None), &listener).unwrap()[0];
        assert!(60 < found[0] && 40 < found[1] && found[2] == 0, "{found:?}");
        assert!(listener.0.lock().unwrap()[1].starts_with("gamma 2.2"));
        let plain = Coloring { gamma: Some(1.0), ..coloring(None) };
        assert_eq!(colorize(&cloud, &plain, &NoProgress).unwrap()[0], [16, 8, 0]);
    }

    #[test]
    fn gamma_brightens_the_middle_of_a_map_and_no_named_map_unasked() {
        let intensity = Some((0..2500).map(|i| (i as f32 / 2499.0).powi(4)).collect());
        let cloud = PointCloud { intensity, ..lattice() };
        let middle =
            |coloring: &Coloring| colorize(&cloud, coloring, &NoProgress).unwrap()[1250][0];
        let plain = Coloring { gamma: Some(1.0), ..coloring(None) };
        assert!(20 + middle(&plain) < middle(&coloring(None)));
        let gray = Some(Colormap::from_name("gray").unwrap());
        let named = Coloring { colormap: gray, ..coloring(Some("intensity")) };
        let named_plain = Coloring { gamma: Some(1.0), ..named.clone() };
        assert_eq!(middle(&named), middle(&named_plain));
        let brightened = Coloring { gamma: Some(2.0), ..named };
        assert!(middle(&named_plain) < middle(&brightened));
    }

    #[test]
    fn few_other_values_among_equal_ones_have_other_colors() {
        let values = (0..1000).map(|i| if i < 10 { 2.0 } else { 0.0 }).collect();
        let scalars = vec![Scalar { name: "structure".into(), values: Values::F64(values) }];
        let cloud = PointCloud { scalars, ..PointCloud::from_positions(vec![Vec3::ZERO; 1000]) };
        let coloring = coloring(Some("structure"));
        let colors = colorize(&cloud, &coloring, &NoProgress).unwrap();
        assert_ne!(colors[0], colors[999]);
        let Legend::Map { low, high, .. } = legend(&cloud, &coloring).unwrap() else {
            panic!("no map");
        };
        assert_eq!((low, high), (0.0, 2.0));
    }

    #[test]
    fn labels_have_colors_of_their_own_unless_a_map_orders_them() {
        let values = Values::F64((0..2500).map(|i| [-1.0, 3.0, 20.0, f64::MAX][i % 4]).collect());
        let scalars = vec![Scalar { name: "label".into(), values: values.clone() }];
        let cloud = PointCloud { scalars, ..lattice() };
        let found = colorize(&cloud, &coloring(Some("label")), &NoProgress).unwrap();
        let expected = [[128; 3], label_color(3), label_color(20), [128; 3]];
        assert_eq!(found[..4], expected);
        let entries = [-1, 3, 20].map(|label| (label, label_color(label)));
        let legend_of = |coloring: &Coloring| legend(&cloud, coloring).unwrap();
        let expected = Legend::Labels { title: "label".into(), entries: entries.to_vec() };
        assert_eq!(legend_of(&coloring(Some("label"))), expected);
        assert_eq!(common_range(&[&cloud], &coloring(None), &"label".parse().unwrap()), None);
        let colormap = Some(Colormap::from_name("viridis").unwrap());
        let ordered = Coloring { colormap, ..coloring(Some("label")) };
        let Legend::Map { low, high, .. } = legend_of(&ordered) else { panic!("no map") };
        assert_eq!((low, high), (-1.0, 20.0));
        let found = colorize(&cloud, &ordered, &NoProgress).unwrap();
        assert_eq!((found[1], found[3]), (ordered.colormap.unwrap().color(4.0 / 21.0), [128; 3]));
        // What is called class without being one of ASPRS is a label.
        let scalars = vec![Scalar { name: "class".into(), values }];
        let cloud = PointCloud { scalars, ..lattice() };
        let class = coloring(Some("class"));
        assert!(ColorSource::Class.is_available_in(&cloud));
        assert_eq!(colorize(&cloud, &class, &NoProgress).unwrap()[1], label_color(3));
    }

    #[test]
    fn columns_are_mapped_from_their_percentiles() {
        let mut cloud = lattice();
        let values = Values::U16((0..2500).collect());
        cloud.scalars.push(Scalar { name: "Deviation".to_owned(), values });
        let listener = Listener(Mutex::default());
        let found = colorize(&cloud, &coloring(Some("deviation")), &listener).unwrap();
        let viridis = Colormap::from_name("viridis").unwrap();
        assert_eq!((found[0], found[2499]), (viridis.color(0.0), viridis.color(1.0)));
        assert!(listener.0.lock().unwrap()[0].contains("50 to 2449 ("));
        assert_eq!(found, colorize(&cloud, &coloring(Some("elevation")), &NoProgress).unwrap());
        let range = Coloring {
            range: Some((0.0, 10_000.0)),
            colormap: Some(Colormap::from_name("gray").unwrap()),
            ..coloring(Some("deviation"))
        };
        assert_eq!(colorize(&cloud, &range, &NoProgress).unwrap()[2000], [51; 3]);
    }

    #[test]
    fn the_note_about_colors_names_reversed_maps_and_no_origin_of_ranges_that_it_is_told() {
        let listener = Listener(Mutex::default());
        let reversed = Some(Colormap::from_name("turbo_r").unwrap());
        let range = Some((0.0, 10.0));
        let coloring = Coloring { range, colormap: reversed, ..coloring(Some("elevation")) };
        colorize(&lattice(), &coloring, &listener).unwrap();
        let notes = listener.0.into_inner().unwrap();
        assert_eq!(notes, ["color elevation from 0.00 to 10.00, map turbo_r"]);
    }

    #[test]
    fn the_range_of_several_clouds_is_that_of_all_their_values() {
        let low = lattice();
        let high = PointCloud { origin: crate::math::DVec3::new(0.0, 0.0, 2500.0), ..lattice() };
        let coloring = coloring(Some("elevation"));
        let of = |clouds: &[&PointCloud]| common_range(clouds, &coloring, &ColorSource::Elevation);
        let (range, line) = of(&[&low, &high]).unwrap();
        let rounded = |(low, high): (f64, f64)| (low.round(), high.round());
        assert_eq!(rounded(range), (100.0, 4899.0));
        assert!(line.starts_with("color elevation from 100 to 4899 ("), "{line}");
        assert_eq!(rounded(of(&[&low]).unwrap().0), (50.0, 2449.0));
        let given = Coloring { range: Some((0.0, 1.0)), ..coloring.clone() };
        assert_eq!(common_range(&[&low], &given, &ColorSource::Elevation), None);
        assert_eq!(common_range(&[&low], &coloring, &ColorSource::Rgb), None);
    }

    #[test]
    fn intensity_is_never_black_unless_its_map_is_named() {
        let intensity = Some((0..2500).map(|i| i as f32).collect());
        let cloud = PointCloud { intensity, ..lattice() };
        let listener = Listener(Mutex::default());
        let chosen = colorize(&cloud, &coloring(None), &listener).unwrap();
        assert!(70 < chosen[0][0] && chosen[0][0] < 80, "{:?}", chosen[0]);
        assert_eq!(listener.0.lock().unwrap().len(), 1);
        let named = coloring(Some("intensity"));
        assert_eq!(colorize(&cloud, &named, &NoProgress).unwrap(), chosen);
        let gray = Coloring { colormap: Some(Colormap::from_name("gray").unwrap()), ..named };
        assert_eq!(colorize(&cloud, &gray, &NoProgress).unwrap()[0], [0; 3]);
    }

    #[test]
    fn the_error_for_a_missing_column_lists_the_known_ones() {
        let mut cloud = lattice();
        cloud
            .scalars
            .push(Scalar { name: "GpsTime".to_owned(), values: Values::U8(vec![1; 2500]) });
        for source in ["rgb", "intensity", "class", "normal", "height"] {
            let error =
                colorize(&cloud, &coloring(Some(source)), &NoProgress).unwrap_err().to_string();
            assert!(error.contains(source) && error.contains("GpsTime"), "{error}");
        }
    }
}
