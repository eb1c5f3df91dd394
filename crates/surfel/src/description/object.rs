//! Objects: files with a place, a material and settings of their own.

use super::keys::{KeyedSettings, settings};
use super::material::{MaterialDescription, MaterialRule};
use super::rule::{Checked, FINITE, Flag, List, MAX_LENGTH, Rule, Text, absolute_text, as_number};
use super::vector_rule::Vector;
use super::{
    Invalid, ObjectSettings, read_value, take_normalized, unknown_key, write_parts, write_table,
};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use surfel_core::math::{DAffine3, DQuat, DVec3};
use surfel_core::scene::Transform;

settings! {
    /// An object of a scene: what its files hold, once or at several places.
    pub struct ObjectDescription {
        /// Name for `parent` and animations [default: the name of the first file without its extension].
        name: String, Text, "NAME";
        /// Name in the viewer's list of objects [default: the name of the file, or of the object].
        label: String, Text, "TEXT";
        /// Frames per second of a sequence of files.
        fps: f64 = 10.0, FPS, "N";
        /// Makes one cloud of several files; otherwise they are a sequence, shown one after another.
        merge: bool = false, Flag, "BOOL";
        /// Material in place of those of the file.
        material: MaterialDescription, MaterialRule, "MATERIAL";
        /// Name of an object before this one; it moves, turns and scales this object too.
        parent: String, Text, "NAME";
        /// False hides the object and its children.
        visible: bool = true, Flag, "BOOL";
    }
    with {
        /// The files: one, or several that are merged or shown in turn.
        files: Vec<PathBuf>,
        /// Position, rotation and scale in the coordinates of the parent.
        placement: Placement,
        /// Further places of the same content, in the object's own coordinates.
        instances: Vec<Placement>,
        /// Settings of surface, preparation and colour that differ from the scene's.
        settings: ObjectSettings,
    }
}

const FPS: Checked = Checked {
    allows: |x| (0.01..=1000.0).contains(&x),
    expected: "frames per second from 0.01 to 1000",
};

settings! {
    /// Position, rotation and scale: scale comes first, then rotation, then translation.
    pub struct Placement {
        /// Position in the coordinates of the parent.
        translate: DVec3, Vector, "X,Y,Z";
        /// Rotation in degrees about x, then y, then z; or an axis and an angle.
        rotate: Rotation, RotationRule, "X,Y,Z";
        /// Scale: a number, or one for each axis.
        scale: DVec3, ScaleRule, "FACTOR";
        /// 16 numbers row by row, instead of the other three.
        matrix: Vec<f64>, List { rule: FINITE, expected: "16 numbers, row by row" }, "NUMBERS";
    }
}

/// A rotation, counter-clockwise as the axis points to the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rotation {
    /// Degrees about the x axis, then y, then z.
    Degrees(DVec3),
    /// Degrees about an axis.
    AxisAngle {
        /// Direction of the axis; any length but 0.
        axis: DVec3,
        /// Angle in degrees.
        angle: f64,
    },
}

impl Rotation {
    /// Returns the rotation as a quaternion.
    pub fn quaternion(&self) -> DQuat {
        match *self {
            Self::Degrees(degrees) => {
                let [x, y, z] = degrees.to_array().map(f64::to_radians);
                DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
            }
            Self::AxisAngle { axis, angle } => {
                DQuat::from_axis_angle(axis.normalize_or(DVec3::Z), angle.to_radians())
            }
        }
    }

    /// Returns the rotation at a weight from 0 (this one) to 1 (`other`): by the angles if these turn by half a turn or more,
    /// and the shorter way otherwise.
    pub(super) fn toward(&self, other: &Self, weight: f64) -> DQuat {
        match (*self, *other) {
            _ if self.turn_deg(other) < 180.0 => {
                self.quaternion().slerp(other.quaternion(), weight)
            }
            (Self::AxisAngle { axis, angle: from }, Self::AxisAngle { angle: to, .. }) => {
                let angle = from + weight * (to - from);
                Self::AxisAngle { axis, angle }.quaternion()
            }
            (Self::Degrees(from), Self::Degrees(to)) => {
                Self::Degrees(from.lerp(to, weight)).quaternion()
            }
            _ => self.quaternion(),
        }
    }

    /// Returns by how many degrees the angles turn from this rotation to another about the same axes; 0 if the axes differ.
    pub(super) fn turn_deg(&self, other: &Self) -> f64 {
        match (*self, *other) {
            (Self::Degrees(from), Self::Degrees(to)) => (to - from).abs().max_element(),
            (Self::AxisAngle { axis: a, angle: from }, Self::AxisAngle { axis: b, angle: to })
                if a.normalize_or_zero().distance(b.normalize_or_zero()) < 1e-9 =>
            {
                (to - from).abs()
            }
            _ => 0.0,
        }
    }
}

/// `[x, y, z]` in degrees, or `{ axis = [0, 0, 1], angle = 90 }`.
pub(super) struct RotationRule;

impl Rule<Rotation> for RotationRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<Rotation, Invalid> {
        let axis_angle = |table: &Map<String, Value>| {
            let axis = Vector.read(table.get("axis")?, folder).ok()?;
            let angle = as_number(table.get("angle")?)?;
            (table.len() == 2 && axis.try_normalize().is_some())
                .then_some(Rotation::AxisAngle { axis, angle })
        };
        let rotation = match value {
            Value::Object(table) => axis_angle(table),
            value => Vector.read(value, folder).ok().map(Rotation::Degrees),
        };
        rotation.ok_or_else(|| {
            Invalid::new(
                "expected degrees about x, y and z as in [0, 0, 90], or an axis and an angle as in \
                 { axis = [0, 0, 1], angle = 90 }",
            )
        })
    }

    fn write(&self, value: &Rotation) -> Value {
        match value {
            Rotation::Degrees(degrees) => json!(degrees.to_array()),
            Rotation::AxisAngle { axis, angle } => {
                json!({ "axis": axis.to_array(), "angle": angle })
            }
        }
    }
}

/// One factor for all axes, or three.
pub(super) struct ScaleRule;

impl Rule<DVec3> for ScaleRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<DVec3, Invalid> {
        let even = as_number(value).filter(|factor| factor.abs() < MAX_LENGTH).map(DVec3::splat);
        let scale = even.or_else(|| Vector.read(value, folder).ok());
        scale.ok_or_else(|| Invalid::new("expected a number or three, below 1e15"))
    }

    fn write(&self, value: &DVec3) -> Value {
        if value.x == value.y && value.y == value.z {
            json!(value.x)
        } else {
            json!(value.to_array())
        }
    }
}

impl Placement {
    /// Returns the transform from the object's coordinates to its parent's.
    ///
    /// # Errors
    ///
    /// Fails for a matrix beside other keys, and for a transform that leaves nothing visible.
    pub fn transform(&self) -> Result<Transform, Invalid> {
        if let Some(numbers) = &self.matrix {
            let others = Self { matrix: None, ..self.clone() };
            if others != Self::default() {
                return Err(Invalid::at(
                    "matrix",
                    "excludes translate, rotate and scale; leave out either",
                ));
            }
            let rows = <[f64; 16]>::try_from(&numbers[..]);
            let rows =
                rows.map_err(|_| Invalid::at("matrix", "expected 16 numbers, row by row"))?;
            return checked("matrix", Transform::Matrix(affine(rows)));
        }
        let translation = self.translate.unwrap_or(DVec3::ZERO);
        let rotation = self.rotate.map_or(DQuat::IDENTITY, |rotation| rotation.quaternion());
        let scale = self.scale.unwrap_or(DVec3::ONE);
        checked("scale", Transform::Trs { translation, rotation, scale })
    }
}

fn checked(key: &str, transform: Transform) -> Result<Transform, Invalid> {
    let matrix = transform.matrix();
    let largest = matrix.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let volume = matrix.matrix3.determinant();
    if matrix.is_finite() && largest < MAX_LENGTH && volume != 0.0 {
        return Ok(transform);
    }
    Err(Invalid::at(key, "the object would be flat, empty or infinite"))
}

/// Returns the transform of a 4x4 matrix row by row; the last row is ignored.
fn affine(rows: [f64; 16]) -> DAffine3 {
    let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
    DAffine3::from_cols(column(0), column(1), column(2), column(3))
}

/// Returns for each object the index of the first one before it that holds the same geometry, if there is one: the same
/// files with the same settings are held once.
pub fn twins(objects: &[ObjectDescription]) -> Vec<Option<usize>> {
    let mut first_of: BTreeMap<&[PathBuf], Vec<usize>> = BTreeMap::new();
    let twins = objects.iter().enumerate().map(|(i, object)| {
        let firsts = first_of.entry(&object.files).or_default();
        let twin = firsts.iter().copied().find(|first| objects[*first].has_same_content(object));
        if twin.is_none() {
            firsts.push(i);
        }
        twin
    });
    twins.collect()
}

impl ObjectDescription {
    /// An object that shows one file where its coordinates say.
    pub fn new(file: impl Into<PathBuf>) -> Self {
        Self { files: vec![file.into()], ..Self::default() }
    }

    /// Returns the name that was given, or that of the first file without its extension.
    pub fn name(&self) -> String {
        let stem = || Some(self.files.first()?.file_stem()?.to_string_lossy().into_owned());
        self.name.clone().or_else(stem).unwrap_or_default()
    }

    /// Returns the paths and names by which a material may be chosen for the object.
    pub fn names(&self) -> Vec<PathBuf> {
        self.files.iter().cloned().chain([PathBuf::from(self.name())]).collect()
    }

    /// Returns true if both hold the same geometry, at whatever place.
    fn has_same_content(&self, other: &Self) -> bool {
        let has_same_rate = self.files.len() == 1 || self.fps() == other.fps();
        self.files == other.files
            && self.merge() == other.merge()
            && self.settings == other.settings
            && has_same_rate
    }

    /// Reads an object from a table. Files start at `folder`.
    ///
    /// # Errors
    ///
    /// Fails for unknown keys and wrong values, and without a file.
    pub(super) fn read(table: &Map<String, Value>, folder: &Path) -> Result<Self, Invalid> {
        let mut object = Self::default();
        let mut table = take_normalized(table);
        object.files = read_files(&mut table, folder)?;
        if let Some(instances) = table.shift_remove("instances") {
            object.instances = read_instances(&instances, folder)?;
        }
        for (key, value) in &table {
            let parts: [&mut dyn KeyedSettings; 4] = [
                &mut object.settings.surface,
                &mut object.settings.preparation,
                &mut object.settings.color,
                &mut object.placement,
            ];
            let mut is_known = false;
            for part in parts {
                is_known = is_known || read_value(part, key, value, folder)?;
            }
            if !is_known && !read_value(&mut object, key, value, folder)? {
                return Err(unknown_key(key, object.table_keys()));
            }
        }
        object.check()?;
        Ok(object)
    }

    fn table_keys(&self) -> Vec<String> {
        let own = self.keys().into_iter().chain(self.placement.keys());
        let settings = self.settings.parts().into_iter().flat_map(|part| part.settings.keys());
        let names = own.chain(settings).map(|key| key.name.to_owned());
        names.chain(["file", "files", "instances"].map(str::to_owned)).collect()
    }

    fn check(&self) -> Result<(), Invalid> {
        self.placement.transform()?;
        for (i, instance) in self.instances.iter().enumerate() {
            instance.transform().map_err(|error| error.within(&format!("instances[{i}]")))?;
        }
        super::exclusive::check(&self.settings.parts())
    }

    /// Writes the object as a table, with files from the root.
    pub(super) fn write(&self) -> Value {
        let mut table = Map::new();
        let files: Vec<String> = self.files.iter().map(|file| absolute_text(file)).collect();
        match &files[..] {
            [only] => table.insert("file".into(), json!(only)),
            several => table.insert("files".into(), json!(several)),
        };
        table.extend(write_table(self));
        table.extend(write_table(&self.placement));
        if !self.instances.is_empty() {
            let instances =
                self.instances.iter().map(|instance| Value::Object(write_table(instance)));
            table.insert("instances".into(), instances.collect());
        }
        table.extend(write_parts(&self.settings.parts()));
        Value::Object(table)
    }
}

fn read_instances(value: &Value, folder: &Path) -> Result<Vec<Placement>, Invalid> {
    let tables = match value {
        Value::Array(tables) => &tables[..],
        table => std::slice::from_ref(table),
    };
    let read = |(i, table): (usize, &Value)| {
        let within = |error: Invalid| error.within(&format!("instances[{i}]"));
        let Value::Object(table) = table else {
            return Err(within(Invalid::new("expected a table").found(table)));
        };
        let mut placement = Placement::default();
        super::read_table(&mut placement, table, folder).map_err(within)?;
        Ok(placement)
    };
    tables.iter().enumerate().map(read).collect()
}

/// Takes `file` or `files` out of a table; a pattern becomes the files that match it.
fn read_files(table: &mut Map<String, Value>, folder: &Path) -> Result<Vec<PathBuf>, Invalid> {
    let files = match (table.shift_remove("file"), table.shift_remove("files")) {
        (Some(Value::String(file)), None) => vec![file],
        (Some(other), None) => {
            return Err(Invalid::at("file", "expected a name in quotes").found(&other));
        }
        (None, Some(Value::String(pattern))) => {
            return super::pattern::matching(&folder.join(&pattern))
                .map_err(|error| Invalid::at("files", error).found(&Value::String(pattern)));
        }
        (None, Some(Value::Array(files))) if !files.is_empty() => {
            let names = files.iter().map(|file| file.as_str().map(str::to_owned));
            names
                .collect::<Option<_>>()
                .ok_or_else(|| Invalid::at("files", "expected names in quotes"))?
        }
        _ => {
            return Err(Invalid::at(
                "file",
                "expected `file = \"name\"`, or `files` with several names or a `*`",
            ));
        }
    };
    Ok(files.iter().map(|file| folder.join(file)).collect())
}
