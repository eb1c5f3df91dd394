//! What the colours on the page mean.

use serde_json::{Value, json};
use surfel::points::PointCloud;
use surfel::scene::color::{self, Coloring, Legend};

/// Of the first cloud, as the page shows it; null where the colours speak for themselves.
pub fn legend(clouds: &[PointCloud], coloring: &Coloring) -> Value {
    let Some(Ok(found)) = clouds.first().map(|cloud| color::legend(cloud, coloring)) else {
        return Value::Null;
    };
    match found {
        Legend::None => Value::Null,
        Legend::Map { title, low, high, colors } => {
            let colors: Vec<String> = colors.into_iter().map(hex).collect();
            json!({ "kind": "map", "title": title, "low": low, "high": high, "colors": colors })
        }
        Legend::Classes(classes) => {
            let entry = |(class, name, color)| json!({ "name": format!("{class} {name}"), "color": hex(color) });
            let entries: Vec<Value> = classes.into_iter().map(entry).collect();
            json!({ "kind": "classes", "title": "class", "entries": entries })
        }
    }
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}
