//! Options of materials.

use super::{Usage, parse};
use clap::Args;
use std::path::Path;
use surfel::math::Vec3;
use surfel::scene::Material;

#[derive(Args)]
#[command(next_help_heading = "Materials")]
pub struct MaterialArgs {
    /// What things are made of: matte, metal, mirror, glass, plastic, emissive or unlit, for all files or
    /// for one, as in statue.ply=glass. Properties may follow: glass:ior=1.33,color=#88ccff. May be
    /// given several times.
    #[arg(long, value_name = "[FILE=]NAME", value_parser = choice)]
    material: Vec<Choice>,
    /// Reflections and refractions of a ray, at most.
    #[arg(long, value_name = "N", default_value_t = 8,
        value_parser = clap::value_parser!(u32).range(0..=64))]
    pub max_depth: u32,
}

/// A material for one file or for all.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    file: Option<String>,
    pub material: Material,
    /// Its name and properties as they were typed.
    pub words: (String, Vec<(String, String)>),
}

impl MaterialArgs {
    /// The material asked for a file: its own before that for all, the last one given.
    pub fn of(&self, file: &Path) -> Option<&Choice> {
        self.of_file(file).or_else(|| self.for_all())
    }

    /// The material asked for whatever has none of its own.
    pub fn for_all(&self) -> Option<&Choice> {
        self.material.iter().rev().find(|choice| choice.file.is_none())
    }

    /// The material asked for this very file.
    pub fn of_file(&self, file: &Path) -> Option<&Choice> {
        self.material
            .iter()
            .rev()
            .find(|choice| choice.file.as_ref().is_some_and(|name| is_named(file, name)))
    }

    /// Fails if a material is for a file or an object that is not there.
    pub fn check_names(&self, known: &[&Path]) -> Result<(), Usage> {
        for name in self.material.iter().filter_map(|choice| choice.file.as_ref()) {
            if !known.iter().any(|file| is_named(file, name)) {
                let known: Vec<String> =
                    known.iter().map(|file| file.display().to_string()).collect();
                return Err(Usage(format!(
                    "--material {name}=...: nothing of that name is to be rendered; there is {}",
                    known.join(", ")
                )));
            }
        }
        Ok(())
    }
}

/// By its path, its name, or its name without the extension.
fn is_named(file: &Path, name: &str) -> bool {
    let parts = [Some(file.as_os_str()), file.file_name(), file.file_stem()];
    parts.into_iter().flatten().any(|part| part == name)
}

fn choice(text: &str) -> Result<Choice, String> {
    // Of `a=glass:ior=1.5` the first sign separates the file, of `glass:ior=1.5` none does.
    let (name, properties) = match text.rsplit_once(':') {
        Some((name, properties)) if properties.contains('=') => (name, Some(properties)),
        _ => (text, None),
    };
    let (file, name) = match name.rsplit_once('=') {
        Some((file, name)) => (Some(file.to_owned()), name),
        None => (None, name),
    };
    let mut material: Material = name.parse().map_err(|error: surfel::Error| error.to_string())?;
    let mut words = (name.to_owned(), Vec::new());
    for property in properties.into_iter().flat_map(|text| text.split(',')) {
        let (name, value) = property.split_once('=').ok_or_else(|| {
            format!("{property}: expected a property and its value, as in ior=1.33")
        })?;
        set(&mut material, name.trim(), value.trim())
            .map_err(|error| format!("{name}: {error}"))?;
        words.1.push((name.trim().to_owned(), value.trim().to_owned()));
    }
    Ok(Choice { file, material, words })
}

/// Sets a property by its name.
pub fn set(material: &mut Material, name: &str, value: &str) -> Result<(), String> {
    let share = |value: &str| parse::number_in::<0, 1>(value).map(|number| number as f32);
    match name {
        "color" => {
            material.base_color = parse::color(value)?;
            material.ignores_colors = true;
        }
        "alpha" => {
            material.alpha = share(value)?;
            material.alpha_mode = surfel::scene::AlphaMode::Blend;
        }
        "metallic" => material.metallic = share(value)?,
        "roughness" => material.roughness = share(value)?,
        "transmission" => material.transmission = share(value)?,
        "ior" => material.ior = parse::number_in::<1, 4>(value)? as f32,
        "attenuation-color" => {
            material.attenuation_color = parse::color(value)?.max(Vec3::splat(1e-4));
        }
        "attenuation-distance" => material.attenuation_distance = parse::positive(value)? as f32,
        "emissive" => material.emissive = parse::color(value)?,
        "glow" => material.glow = parse::number_in::<0, 10_000>(value)? as f32,
        "thin" => {
            material.is_thin = value.parse().map_err(|_| "expected true or false".to_owned())?;
        }
        _ => {
            return Err(format!("no such property; known: {}", PROPERTIES.join(", ")));
        }
    }
    Ok(())
}

pub const PROPERTIES: [&str; 11] = [
    "color",
    "alpha",
    "metallic",
    "roughness",
    "transmission",
    "ior",
    "attenuation-color",
    "attenuation-distance",
    "emissive",
    "glow",
    "thin",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_material_is_for_all_files_or_for_one() {
        let glass = choice("glass").unwrap();
        assert_eq!((glass.file, glass.material), (None, Material::GLASS));
        let mirror = choice("a b.ply=mirror").unwrap();
        assert_eq!((mirror.file.as_deref(), mirror.material), (Some("a b.ply"), Material::MIRROR));
        let water = choice("pool.las=glass:ior=1.33,color=#ffffff").unwrap();
        assert_eq!((water.file.as_deref(), water.material.ior), (Some("pool.las"), 1.33));
        for wrong in ["brick", "a.ply=", "glass:ior", "glass:ior=9", "glass:colour=#fff"] {
            assert!(choice(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_file_is_named_by_path_name_or_stem() {
        let file = Path::new("scans/site.copc.laz");
        for name in ["scans/site.copc.laz", "site.copc.laz", "site.copc"] {
            assert!(is_named(file, name), "{name}");
        }
        assert!(!is_named(file, "site"));
    }
}
