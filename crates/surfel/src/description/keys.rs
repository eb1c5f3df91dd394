//! Declares settings: one line gives a field, its key in scene files, its option, its help and its default.

use super::Invalid;
use super::rule::Arity;
use serde_json::Value;
use std::path::Path;

/// One key of a scene file, which is also one option of the program.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// The key within its part, as in `view_angle`.
    pub name: &'static str,
    /// Meaning of the key in sentences, with its unit.
    pub doc: &'static str,
    /// Placeholder for the value in help texts, as in `DEG`.
    pub value_name: &'static str,
    /// Whether the key may be given without a value.
    pub arity: Arity,
    /// True if values may begin with a hyphen.
    pub may_begin_with_hyphen: bool,
    /// The value that counts if none is set; `None` if it is chosen from the data.
    pub default: Option<Value>,
    /// True for the keys that are used most; short help texts list no others.
    pub is_common: bool,
}

/// A struct of optional settings whose fields are keys of a scene file.
pub trait KeyedSettings {
    /// Returns all keys, in the order of the fields.
    fn keys(&self) -> Vec<Key>;

    /// Sets a key from a value of a scene file. Relative paths in the value start at `folder`.
    ///
    /// # Errors
    ///
    /// Fails with what was expected if the value is not valid, and for an unknown key.
    fn set(&mut self, name: &str, value: &Value, folder: &Path) -> Result<(), Invalid>;

    /// Returns the value of a key as a scene file has it, or `None` if it is not set.
    fn get(&self, name: &str) -> Option<Value>;

    /// Makes a key automatic again.
    fn unset(&mut self, name: &str);

    /// Sets each key that is not set to its default, if it has one.
    fn fill_defaults(&mut self) {
        for Key { name, default, .. } in self.keys() {
            if let (None, Some(default)) = (self.get(name), default) {
                // A default is valid by its own rule.
                let _ = self.set(name, &default, Path::new(""));
            }
        }
    }
}

/// Declares a struct of settings.
///
/// Each field reads `/// doc`, `name: Type [= default], rule, "VALUE_NAME"[, common];`. The struct holds an `Option` for
/// each field; a field with a default also gets a method of its name that returns the value or the default. Fields
/// after `with` are plain and are no keys.
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $name:ident {
            $( $(#[doc = $doc:literal])+ $field:ident : $type:ty $(= $default:expr)?, $rule:expr, $value_name:literal $(, $common:ident)?; )*
        }
        $( with { $( $(#[$plain_meta:meta])* $plain:ident : $plain_type:ty, )* } )?
    ) => {
        $(#[$meta])*
        #[allow(rustdoc::broken_intra_doc_links, reason = "brackets stand for what may be left out")]
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name {
            $( $(#[doc = $doc])+ pub $field: Option<$type>, )*
            $( $( $(#[$plain_meta])* pub $plain: $plain_type, )* )?
        }

        impl $name {
            $( settings!(@getter $field: $type $(= $default)?); )*

            /// Replaces each setting here by that of `over`, where `over` has one.
            pub fn overlay(&mut self, over: &Self) {
                $( if over.$field.is_some() { self.$field.clone_from(&over.$field); } )*
            }
        }

        impl $crate::description::KeyedSettings for $name {
            fn keys(&self) -> Vec<$crate::description::Key> {
                vec![ $( $crate::description::Key {
                    name: stringify!($field),
                    doc: concat!($($doc, "\n"),+).trim_ascii(),
                    value_name: $value_name,
                    arity: $crate::description::rule::Rule::<$type>::arity(&$rule),
                    may_begin_with_hyphen:
                        $crate::description::rule::Rule::<$type>::may_begin_with_hyphen(&$rule),
                    default: settings!(@default $rule, $type $(, $default)?),
                    is_common: settings!(@is_common $($common)?),
                } ),* ]
            }

            fn set(
                &mut self,
                name: &str,
                value: &serde_json::Value,
                folder: &std::path::Path,
            ) -> Result<(), $crate::description::Invalid> {
                match name {
                    $( stringify!($field) => {
                        let read = $crate::description::rule::Rule::<$type>::read(&$rule, value, folder);
                        self.$field = Some(read.map_err(|error| error.found_unless_nested(value))?);
                        Ok(())
                    } )*
                    _ => Err($crate::description::Invalid::new("unknown key")),
                }
            }

            fn get(&self, name: &str) -> Option<serde_json::Value> {
                match name {
                    $( stringify!($field) => self
                        .$field
                        .as_ref()
                        .map(|value| $crate::description::rule::Rule::<$type>::write(&$rule, value)), )*
                    _ => None,
                }
            }

            fn unset(&mut self, name: &str) {
                match name {
                    $( stringify!($field) => self.$field = None, )*
                    _ => {}
                }
            }
        }
    };
    (@getter $field:ident: $type:ty) => {};
    (@getter $field:ident: $type:ty = $default:expr) => {
        #[doc = concat!("Returns `", stringify!($field), "`, or its default.")]
        pub fn $field(&self) -> $type {
            self.$field.clone().unwrap_or($default)
        }
    };
    (@is_common) => { false };
    (@is_common common) => { true };
    (@default $rule:expr, $type:ty) => { None };
    (@default $rule:expr, $type:ty, $default:expr) => {
        Some($crate::description::rule::Rule::<$type>::write(&$rule, &$default))
    };
}

pub(super) use settings;
