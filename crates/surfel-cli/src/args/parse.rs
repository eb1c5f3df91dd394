//! Values as they are typed: vectors, directions, sizes, colours.

use surfel::image::{Colormap, decode_srgb8};
use surfel::math::{DVec3, Vec3};
use surfel::scene::color::parse_hex;
use surfel::scene::{Background, ClipBox, ClipPlane};

/// `x,y,z`, finite.
pub fn vector(text: &str) -> Result<DVec3, String> {
    let numbers = numbers(text).filter(|numbers| numbers.len() == 3);
    let numbers = numbers.ok_or("expected three numbers as in 1.5,-2,0")?;
    let vector = DVec3::from_slice(&numbers);
    // Beyond this the squares of lengths are no longer finite in f32.
    if vector.abs().max_element() < 1e15 {
        Ok(vector)
    } else {
        Err("expected values below 1e15".into())
    }
}

/// A vector that points somewhere.
pub fn direction(text: &str) -> Result<DVec3, String> {
    let vector = vector(text)?;
    if (vector.length_squared() - 1.0).abs() < 1e-6 {
        // What was written by a dry run comes back bit by bit.
        return Ok(vector);
    }
    vector.try_normalize().ok_or_else(|| "expected a direction other than 0,0,0".into())
}

/// Bounds as PDAL writes them: `([x0, x1], [y0, y1], [z0, z1])`; two ranges are of any height.
pub fn clip_box(text: &str) -> Result<ClipBox, String> {
    let wrong = "expected two or three ranges from low to high as in ([0,10],[0,10],[2,5])";
    match ranges(text).as_deref() {
        Some([x, y]) => Ok(box_of([*x, *y, [f64::NEG_INFINITY, f64::INFINITY]])),
        Some([x, y, z]) => Ok(box_of([*x, *y, *z])),
        _ => Err(wrong.into()),
    }
}

fn box_of(ranges: [[f64; 2]; 3]) -> ClipBox {
    let [low, high] = [0, 1].map(|end| DVec3::from_array(ranges.map(|range| range[end])));
    ClipBox { low, high }
}

/// `([low,high],[low,high])` and so on.
fn ranges(text: &str) -> Option<Vec<[f64; 2]>> {
    let inner = text.trim().strip_prefix('(')?.strip_suffix(')')?;
    let words: Vec<&str> = inner.split(',').map(str::trim).collect();
    let range = |words: &[&str]| {
        let [low, high] = words else { return None };
        let inner = [low.strip_prefix('[')?, high.strip_suffix(']')?].join(",");
        let range: [f64; 2] = numbers(&inner)?.try_into().ok()?;
        (range[0] <= range[1]).then_some(range)
    };
    words.chunks(2).map(range).collect()
}

/// `x,y,z,nx,ny,nz`: a point of the plane and the normal.
pub fn clip_plane(text: &str) -> Result<ClipPlane, String> {
    let numbers = numbers(text).filter(|numbers| numbers.len() == 6);
    let numbers = numbers.ok_or("expected a point and a normal as in 0,0,5,0,0,1")?;
    let [point, normal] = [0, 3].map(|first| DVec3::from_slice(&numbers[first..]));
    match normal.try_normalize() {
        Some(normal) => Ok(ClipPlane { point, normal }),
        None => Err("expected a normal other than 0,0,0".into()),
    }
}

/// `+X`, `-Y`, `Z` and so on, or a vector.
pub fn up(text: &str) -> Result<Vec3, String> {
    let (sign, axis) = match text.strip_prefix('-') {
        Some(axis) => (-1.0, axis),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    let axis = match axis {
        "X" | "x" => Vec3::X,
        "Y" | "y" => Vec3::Y,
        "Z" | "z" => Vec3::Z,
        _ => {
            let up = direction(text).map_err(|_| "expected +X, -X, +Y, -Y, +Z, -Z or x,y,z")?;
            return Ok(up.as_vec3());
        }
    };
    Ok(sign * axis)
}

/// `1920x1080` or `1920,1080`.
pub fn resolution(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once(['x', ',']);
    let sides = sides.and_then(|(w, h)| Some((w.trim().parse().ok()?, h.trim().parse().ok()?)));
    let (width, height): (u32, u32) = sides.ok_or("expected width and height as in 1920x1080")?;
    let n_pixels = u64::from(width) * u64::from(height);
    if (1..=surfel::render::MAX_PIXELS).contains(&n_pixels) {
        Ok((width, height))
    } else {
        Err(format!("expected 1 to {} pixels in all", surfel::render::MAX_PIXELS))
    }
}

/// `lo,hi`.
pub fn range(text: &str) -> Result<(f64, f64), String> {
    match numbers(text).as_deref() {
        Some(&[low, high]) if low != high => Ok((low, high)),
        _ => Err("expected two different numbers as in 0,255".into()),
    }
}

/// `transparent`, `surroundings`, `gradient`, `#RRGGBB`, or two colours: top and bottom.
pub fn background(text: &str) -> Result<Background, String> {
    if text == "transparent" {
        return Ok(Background::Transparent);
    }
    if text == "surroundings" {
        return Ok(Background::Surroundings);
    }
    let text = if text == "gradient" { GRADIENT } else { text };
    let colors: Option<Vec<Vec3>> = text.split(',').map(|color| linear(color.trim())).collect();
    match colors.as_deref() {
        Some(&[plain]) => Ok(Background::Gradient { top: plain, bottom: plain }),
        Some(&[top, bottom]) => Ok(Background::Gradient { top, bottom }),
        _ => Err("expected #RRGGBB, two such as in #AAAAAA,#BBBBBB, gradient, surroundings or \
                 transparent"
            .into()),
    }
}

/// Dark enough above for light stone to stand out, light enough below for what is dark.
const GRADIENT: &str = "#6f7c8a,#c9ced3";

/// `#RRGGBB`, linear.
pub fn color(text: &str) -> Result<Vec3, String> {
    linear(text.trim()).ok_or_else(|| "expected a colour as in #aabbcc".into())
}

fn linear(color: &str) -> Option<Vec3> {
    Some(Vec3::from_array(parse_hex(color)?.map(decode_srgb8)))
}

pub fn colormap(text: &str) -> Result<Colormap, String> {
    Colormap::from_name(text).map_err(|error| error.to_string())
}

/// Bytes: a number with K, M, G or T of 1024 each, or without.
pub fn memory(text: &str) -> Result<u64, String> {
    let upper = text.to_uppercase();
    let short = upper.trim_end_matches('B').trim_end_matches('I');
    let (number, power) = match short.char_indices().last() {
        Some((last, unit)) => match "KMGT".find(unit) {
            Some(power) => (&short[..last], power + 1),
            None => (short, 0),
        },
        None => (short, 0),
    };
    let number: Option<f64> = number.trim().parse().ok();
    let bytes = number.map(|number| number * 1024f64.powi(power as i32));
    match bytes {
        Some(bytes) if 1.0 <= bytes && bytes.is_finite() => Ok(bytes as u64),
        _ => Err("expected a size as in 800M or 8G".into()),
    }
}

/// A number in a range, both ends included.
pub fn number_in<const LOW: i32, const HIGH: i32>(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok();
    let number = number.filter(|number| (f64::from(LOW)..=f64::from(HIGH)).contains(number));
    number.ok_or_else(|| format!("expected a number from {LOW} to {HIGH}"))
}

/// Degrees, as wide as a flat picture can be.
pub fn view_angle(text: &str) -> Result<f64, String> {
    let angle = text.trim().parse::<f64>().ok().filter(|angle| (1e-6..180.0).contains(angle));
    angle.ok_or_else(|| "expected degrees above 0 and below 180".into())
}

/// A positive finite number.
pub fn positive(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok();
    let number = number.filter(|number| 1e-9 < *number && *number < 1e15);
    number.ok_or_else(|| "expected a positive number".into())
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    text.split(',').map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_people_write_them() {
        assert_eq!(vector("1, -2.5,3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        assert_eq!((up("-y"), up("Z"), up("0,0,2")), (Ok(-Vec3::Y), Ok(Vec3::Z), Ok(Vec3::Z)));
        assert_eq!((resolution("64x48"), resolution("64,48")), (Ok((64, 48)), Ok((64, 48))));
        assert_eq!((memory("8G"), memory("1.5KiB"), memory("70")), (Ok(8 << 30), Ok(1536), Ok(70)));
        assert!(matches!(background("transparent"), Ok(Background::Transparent)));
        assert_eq!(background("#fff"), background("#ffffff,#FFFFFF"));
        assert_eq!(range("-1,2"), Ok((-1.0, 2.0)));
        let (low, high) = (DVec3::new(0.0, -2.0, 4e5), DVec3::new(1.0, 3.5, 5e5));
        let text = " ( [0, 1],[-2,3.5] , [4e5,5e5] ) ";
        assert_eq!(clip_box(text), Ok(ClipBox { low, high }));
        let (low, high) = (low.with_z(f64::NEG_INFINITY), high.with_z(f64::INFINITY));
        assert_eq!(clip_box("([0,1],[-2,3.5])"), Ok(ClipBox { low, high }));
        let plane = ClipPlane { point: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::NEG_Z };
        assert_eq!(clip_plane("1,2,3,0,0,-2"), Ok(plane));
    }

    #[test]
    fn nonsense_is_refused() {
        for text in ["", "1,2", "1,2,NaN", "inf,0,0", "1e99,0,0", "a,b,c", "1,2,3,4"] {
            assert!(vector(text).is_err(), "{text}");
        }
        for text in ["0x0", "x", "1920", "-1x5", "100000x100000", "5x"] {
            assert!(resolution(text).is_err(), "{text}");
        }
        for text in ["", "G", "-1G", "NaN", "1e400", "8 potatoes"] {
            assert!(memory(text).is_err(), "{text}");
        }
        for text in
            ["", "0,1,0,1", "[0,1],[0,1]", "([0,1])", "([1,0],[0,1])", "([0,1],[0,1],[0,1],[0,1])"]
        {
            assert!(clip_box(text).is_err(), "{text}");
        }
        for text in ["([0,1],[0,NaN])", "([0 1],[0,1])", "([0,1],0,1])", "([0,1],[0,1],)", "()"] {
            assert!(clip_box(text).is_err(), "{text}");
        }
        for text in ["", "0,0,1", "0,0,0,0,0,0", "0,0,0,0,0,x", "0,0,0,0,0,1,2"] {
            assert!(clip_plane(text).is_err(), "{text}");
        }
        for text in ["", "#12", "red", "#fff,#fff,#fff"] {
            assert!(background(text).is_err(), "{text}");
        }
        assert!(up("W").is_err() && direction("0,0,0").is_err() && range("1,1").is_err());
        assert!(positive("0").is_err() && positive("NaN").is_err() && positive("inf").is_err());
    }
}
