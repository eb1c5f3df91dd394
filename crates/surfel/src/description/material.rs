//! Materials: a kind and properties, as a table or as text like `glass:ior=1.33,color=#88ccff`.

use super::color_rule::Color;
use super::keys::{KeyedSettings, settings};
use super::rule::{Checked, Flag, POSITIVE, Rule, from_core, number};
use super::{Invalid, read_table, write_table};
use serde_json::{Map, Value, json};
use std::ffi::OsStr;
use std::path::Path;
use surfel_core::math::Vec3;
use surfel_core::scene::{AlphaMode, Material};

settings! {
    /// A material after the metallic-roughness model of glTF 2.0.
    pub struct MaterialDescription {
        /// matte, metal, mirror, glass, plastic, emissive or unlit, which gives the properties that are not set.
        kind: String = "matte".to_owned(), Kind, "NAME";
        /// Colour in place of those of points, vertices and the file's materials.
        color: Vec3, Color, "COLOR";
        /// Opacity: 1 hides what is behind, 0 shows all of it.
        alpha: f64, FRACTION, "FRACTION";
        /// 1 reflects in the material's colour, 0 lets light in.
        metallic: f64, FRACTION, "FRACTION";
        /// Blur of the reflection; below 0.02 a perfect mirror.
        roughness: f64, FRACTION, "FRACTION";
        /// Index of refraction: glass 1.5, water 1.33; 1 reflects nothing.
        ior: f64, IOR, "INDEX";
        /// Fraction of the light that enters the surface and passes through it.
        transmission: f64, FRACTION, "FRACTION";
        /// Colour of white light after the attenuation distance inside.
        attenuation_color: Vec3, Color, "COLOR";
        /// Distance inside, in the object's unit, after which white light has the attenuation colour.
        attenuation_distance: f64, POSITIVE, "LENGTH";
        /// A pane without an inside: light goes straight on.
        thin: bool, Flag, "BOOL";
        /// Colour of light that the surface emits.
        emissive: Vec3, Color, "COLOR";
        /// Light that the surface emits, as a multiple of its own colour.
        emissive_strength: f64, EMISSIVE_STRENGTH, "FACTOR";
    }
}

const FRACTION: super::rule::Number = number(0.0, 1.0);
const IOR: super::rule::Number = number(1.0, 4.0);
const EMISSIVE_STRENGTH: Checked =
    Checked { allows: |x| (0.0..=10_000.0).contains(&x), expected: "a number from 0 to 10000" };

/// The name of a material.
struct Kind;

impl Rule<String> for Kind {
    fn read(&self, value: &Value, _: &Path) -> Result<String, Invalid> {
        let name = value
            .as_str()
            .ok_or_else(|| Invalid::new("expected the name of a material in quotes"))?;
        name.parse::<Material>().map_err(from_core)?;
        Ok(name.to_owned())
    }

    fn write(&self, value: &String) -> Value {
        json!(value)
    }
}

impl MaterialDescription {
    /// Returns the material that is described.
    pub fn material(&self) -> Material {
        let mut material: Material = self.kind().parse().unwrap_or_default();
        if let Some(color) = self.color {
            material.base_color = color;
            material.ignores_vertex_colors = true;
        }
        if let Some(alpha) = self.alpha {
            material.alpha = alpha as f32;
            material.alpha_mode = AlphaMode::Blend;
        }
        let set =
            |target: &mut f32, value: Option<f64>| *target = value.map_or(*target, |x| x as f32);
        set(&mut material.metallic, self.metallic);
        set(&mut material.roughness, self.roughness);
        set(&mut material.ior, self.ior);
        set(&mut material.transmission, self.transmission);
        set(&mut material.attenuation_distance, self.attenuation_distance);
        set(&mut material.emissive_strength, self.emissive_strength);
        if let Some(color) = self.attenuation_color {
            material.attenuation_color = color.max(Vec3::splat(1e-4));
        }
        material.emissive = self.emissive.unwrap_or(material.emissive);
        material.is_thin = self.thin.unwrap_or(material.is_thin);
        material
    }

    /// Writes the material as text, as in `glass:ior=1.33`.
    pub fn text(&self) -> String {
        let properties =
            self.keys().into_iter().filter(|key| key.name != "kind").filter_map(|key| {
                let value = match self.get(key.name)? {
                    Value::String(text) => text,
                    other => other.to_string(),
                };
                Some(format!("{}={value}", key.name.replace('_', "-")))
            });
        let properties: Vec<String> = properties.collect();
        match properties.join(",").as_str() {
            "" => self.kind(),
            properties => format!("{}:{properties}", self.kind()),
        }
    }
}

settings! {
    /// Materials for everything, or for files and objects by their names.
    pub struct MaterialSettings {
        /// Material: matte, metal, mirror, glass, plastic, emissive or unlit, for everything or for one file or object,
        /// as in statue.ply=glass. Properties may follow: glass:ior=1.33,color=#88ccff. May be given several times.
        material: Vec<MaterialChoice>, MaterialChoices, "[FILE=]NAME", common;
    }
}

impl MaterialSettings {
    /// Returns the choices in their order; the last one that fits counts.
    pub fn choices(&self) -> &[MaterialChoice] {
        self.material.as_deref().unwrap_or_default()
    }
}

/// A name, text with properties, or a table.
pub(super) struct MaterialRule;

impl Rule<MaterialDescription> for MaterialRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<MaterialDescription, Invalid> {
        match value {
            Value::String(text) => Ok(parse(text)?.1),
            Value::Object(table) => {
                let mut material = MaterialDescription::default();
                read_table(&mut material, table, folder)?;
                Ok(material)
            }
            _ => Err(Invalid::new("expected the name of a material, or a table")),
        }
    }

    fn write(&self, value: &MaterialDescription) -> Value {
        Value::Object(write_table(value))
    }
}

/// A material for everything, or for one file or object.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialChoice {
    /// Name of the object, or path, name or stem of the file; `None` is everything that has no material of its own.
    pub target: Option<String>,
    /// The material.
    pub material: MaterialDescription,
}

impl MaterialChoice {
    /// Returns true if a file or object is meant: by its path, its name, or its name without extension.
    pub fn names(&self, file: &Path) -> bool {
        self.target.as_ref().is_some_and(|target| is_named(file, target))
    }

    /// Writes the choice as text, as in `statue.ply=glass:ior=1.33`.
    pub fn text(&self) -> String {
        match &self.target {
            Some(target) => format!("{target}={}", self.material.text()),
            None => self.material.text(),
        }
    }
}

/// Returns true if a name means a file or object.
pub(super) fn is_named(file: &Path, name: &str) -> bool {
    names_of(file).any(|own| own == name)
}

/// Returns the names that mean a file or object: its path, its name, and its name without extension.
pub fn names_of(file: &Path) -> impl Iterator<Item = &OsStr> {
    [Some(file.as_os_str()), file.file_name(), file.file_stem()].into_iter().flatten()
}

/// Text, a table, or a list of both.
struct MaterialChoices;

impl Rule<Vec<MaterialChoice>> for MaterialChoices {
    fn read(&self, value: &Value, folder: &Path) -> Result<Vec<MaterialChoice>, Invalid> {
        let all = match value {
            Value::Array(all) => &all[..],
            only => std::slice::from_ref(only),
        };
        let read = |value: &Value| match value {
            Value::String(text) => {
                let (target, material) =
                    parse(text).map_err(|error| error.found_unless_nested(value))?;
                Ok(MaterialChoice { target, material })
            }
            other => {
                let material = MaterialRule.read(other, folder)?;
                Ok(MaterialChoice { target: None, material })
            }
        };
        all.iter().map(read).collect()
    }

    fn write(&self, value: &Vec<MaterialChoice>) -> Value {
        value.iter().map(|choice| Value::String(choice.text())).collect()
    }
}

/// Reads `[NAME=]KIND[:PROPERTY=VALUE,...]`.
fn parse(text: &str) -> Result<(Option<String>, MaterialDescription), Invalid> {
    // Where a kind stands last, there are no properties: in `12:30.laz=glass` the colon belongs to the name.
    let ends_with_kind =
        text.rsplit_once('=').is_some_and(|(_, kind)| kind.parse::<Material>().is_ok());
    // The first `=` of `a=glass:ior=1.5` separates the name, none of `glass:ior=1.5` does.
    let (name, properties) = match text.rsplit_once(':') {
        Some((name, properties)) if properties.contains('=') && !ends_with_kind => {
            (name, Some(properties))
        }
        _ => (text, None),
    };
    let (target, kind) = match name.rsplit_once('=') {
        Some((target, kind)) => (Some(target.to_owned()), kind),
        None => (None, name),
    };
    let mut table = Map::new();
    table.insert("kind".into(), json!(kind));
    for property in properties.into_iter().flat_map(|text| text.split(',')) {
        let (name, value) = property.split_once('=').ok_or_else(|| {
            Invalid::new(format!(
                "expected a property and its value as in ior=1.33 instead of `{property}`"
            ))
        })?;
        table.insert(name.trim().to_owned(), json!(value.trim()));
    }
    let mut material = MaterialDescription::default();
    read_table(&mut material, &table, Path::new(""))?;
    Ok((target, material))
}

#[cfg(test)]
mod tests {
    //! Materials as text and as tables.

    use super::*;

    #[test]
    fn a_material_is_for_everything_or_for_one_file() {
        let (target, glass) = parse("glass").unwrap();
        assert_eq!((target, glass.material()), (None, Material::GLASS));
        let (target, mirror) = parse("a b.ply=mirror").unwrap();
        assert_eq!((target.as_deref(), mirror.material()), (Some("a b.ply"), Material::MIRROR));
        let (target, water) = parse("pool.las=glass:ior=1.33,color=#ffffff").unwrap();
        assert_eq!((target.as_deref(), water.material().ior), (Some("pool.las"), 1.33));
        for name in ["12:30.laz", "a=1:b=c"] {
            let (target, glass) = parse(&format!("{name}=glass")).unwrap();
            assert_eq!((target.as_deref(), glass.material()), (Some(name), Material::GLASS));
        }
        for wrong in ["brick", "a.ply=", "glass:ior", "glass:ior=9", "glass:colour=#fff"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn each_property_of_the_text_is_one_of_the_material() {
        let material = |text: &str| parse(text).unwrap().1.material();
        let color = Vec3::new(1.0, 0.0, 0.0);
        let attenuation_color = Vec3::new(1.0, 1.0, 1e-4);
        let emissive = Vec3::new(0.0, 0.0, 1.0);
        let matte = || Material::MATTE;
        for (property, expected) in [
            ("color=#f00", Material { base_color: color, ignores_vertex_colors: true, ..matte() }),
            ("alpha=0.25", Material { alpha: 0.25, alpha_mode: AlphaMode::Blend, ..matte() }),
            ("metallic=0.75", Material { metallic: 0.75, ..matte() }),
            ("roughness=0.5", Material { roughness: 0.5, ..matte() }),
            ("ior=1.25", Material { ior: 1.25, ..matte() }),
            ("transmission=0.5", Material { transmission: 0.5, ..matte() }),
            // No light at all would be lost to rounding.
            ("attenuation-color=#ff0", Material { attenuation_color, ..matte() }),
            ("attenuation-distance=2.5", Material { attenuation_distance: 2.5, ..matte() }),
            ("thin=true", Material { is_thin: true, ..matte() }),
            ("emissive=#00f", Material { emissive, ..matte() }),
            ("emissive-strength=3", Material { emissive_strength: 3.0, ..matte() }),
        ] {
            assert_eq!(material(&format!("matte:{property}")), expected, "{property}");
        }
        let pane = Material { is_thin: true, transmission: 0.5, alpha: 0.5, ..Material::GLASS };
        let pane = Material { alpha_mode: AlphaMode::Blend, ..pane };
        assert_eq!(material("glass:thin=true,transmission=0.5,alpha=0.5"), pane);
        // A property that the kind has can be taken away.
        let dull = Material { emissive_strength: 0.0, ..Material::EMISSIVE };
        assert_eq!(material("emissive:emissive-strength=0"), dull);
    }

    #[test]
    fn text_reads_back_equal() {
        for text in
            ["glass:color=#88ccff,ior=1.33", "plastic", "matte:attenuation-distance=2,thin=true"]
        {
            let (_, material) = parse(text).unwrap();
            assert_eq!(parse(&material.text()).unwrap().1, material, "{text}");
            let table = MaterialRule.write(&material);
            assert_eq!(MaterialRule.read(&table, Path::new("")).unwrap(), material, "{text}");
        }
    }

    #[test]
    fn an_error_names_the_property_and_the_nearest_one() {
        let wrong = json!({ "kind": "glass", "roughnes": 0.5 });
        let error = MaterialRule.read(&wrong, Path::new("")).unwrap_err();
        assert_eq!(error.path, "roughnes");
        assert!(error.message.contains("`roughness`"), "{error}");
        let error = MaterialRule.read(&json!({ "ior": 9 }), Path::new("")).unwrap_err();
        assert_eq!(error.to_string(), "ior: found 9, expected a number from 1 to 4");
    }

    #[test]
    fn a_file_is_named_by_path_name_or_stem() {
        let file = Path::new("scans/site.copc.laz");
        let names = |name: &str| {
            let material = MaterialDescription::default();
            MaterialChoice { target: Some(name.into()), material }.names(file)
        };
        assert!(names("scans/site.copc.laz") && names("site.copc.laz") && names("site.copc"));
        assert!(!names("site"));
    }
}
