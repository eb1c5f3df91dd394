//! The meaning of the colours, as the page shows it.

use serde_json::{Value, json};
use surfel_core::scene::color::{Legend, LegendClass};

/// Returns a legend as the page shows it; null where the colours need none.
pub fn legend_json(legend: &Legend) -> Value {
    match legend {
        Legend::None => Value::Null,
        Legend::Map { title, low, high, colors } => {
            let colors: Vec<String> = colors.iter().copied().map(hex).collect();
            json!({ "kind": "map", "title": title, "low": low, "high": high, "colors": colors })
        }
        Legend::Classes(classes) => {
            let entries = classes.iter().map(|LegendClass { class, name, color, .. }| {
                let name = format!("{class} {name}");
                json!({ "class": class, "name": name, "color": hex(*color) })
            });
            let entries: Vec<Value> = entries.collect();
            json!({ "kind": "classes", "title": "class", "entries": entries })
        }
        Legend::Labels { title, entries } => {
            let entries = entries
                .iter()
                .map(|(label, color)| json!({ "name": label.to_string(), "color": hex(*color) }));
            let entries: Vec<Value> = entries.collect();
            json!({ "kind": "classes", "title": title, "entries": entries })
        }
    }
}

/// Writes an sRGB-encoded colour as a page does.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}
