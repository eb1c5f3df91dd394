//! The result as a table for people.

use serde_json::Value;

/// Returns the results as a table for people.
pub fn table(result: &Value) -> String {
    let mut text = "rays          number      hits  median M/s  best M/s  wall M/s\n".to_owned();
    for (name, row) in result["rays"].as_object().into_iter().flatten() {
        let [rays, hits] = ["rays", "hits"].map(|key| row[key].to_string());
        let [median, best, wall] = ["median_mrays_per_s", "best_mrays_per_s", "wall_mrays_per_s"]
            .map(|key| two(&row[key]));
        text += &format!("{name:<10}{rays:>10}{hits:>10}{median:>12}{best:>10}{wall:>10}");
        if row["hits_per_ray"].is_number() {
            text += &format!("  {} discs a hit", two(&row["hits_per_ray"]));
        }
        text += "\n";
    }
    text + &footer(result)
}

fn footer(result: &Value) -> String {
    let [wall, cpu] = ["build_s", "build_cpu_s"].map(|key| three(&result[key]));
    let is_mesh = result["triangles"].is_number();
    let (one, many) = if is_mesh { ("triangle", "triangles") } else { ("point", "points") };
    let bytes = &result[format!("bytes_per_{one}")];
    let [tree, leaves, total] = ["tree", many, "total"].map(|key| two(&bytes[key]));
    let (threads, simd) = (&result["threads"], result["simd"].as_str().unwrap_or_default());
    let traced = match result["backend"].as_str() {
        Some("gpu") => {
            let device = result["device"].as_str().unwrap_or_default();
            format!("device: {device}; rates by the wall, without transfers")
        }
        _ => format!(
            "threads: {threads}; simd: {simd}; rates by processor time / threads, the last by the wall"
        ),
    };
    format!(
        "built in {wall} s ({cpu} s of processor time); {total} bytes a {one}: tree \
         {tree}, {many} {leaves}\n{traced}"
    )
}

fn two(value: &Value) -> String {
    value.as_f64().map_or("-".into(), |number| format!("{number:.2}"))
}

fn three(value: &Value) -> String {
    value.as_f64().map_or("-".into(), |number| format!("{number:.3}"))
}
