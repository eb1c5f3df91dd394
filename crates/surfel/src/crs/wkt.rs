//! Well-known text of coordinate reference systems: WKT 1 (OGC 01-009) and WKT 2 (ISO 19162).

use surfel_formats::EpsgCodes;

/// Nesting of brackets from which a text is refused: real ones have about eight, and the parser is recursive.
const MAX_DEPTH: usize = 32;

/// Returns the definition in words of PROJ, and the EPSG codes that the text states.
pub fn definition(text: &str) -> Option<(String, Option<EpsgCodes>)> {
    if MAX_DEPTH < depth(text) {
        return None;
    }
    let definition = proj4wkt::wkt_to_projstring(text.trim()).ok()?;
    Some((definition, epsg_codes(text.trim())))
}

/// Returns the name of the system that a text describes, or its kind if it has no name, with its EPSG codes; the text
/// itself if it is no WKT.
pub fn short_name(text: &str) -> String {
    let name = Node::parse(text).and_then(|root| {
        let name = root.name()?;
        let is_name = !["", "unnamed", "unknown"].contains(&name.to_lowercase().trim());
        if is_name { Some(name.to_owned()) } else { root.kind() }
    });
    match (name, epsg_codes(text.trim())) {
        (Some(name), Some(codes)) => {
            let vertical = codes.vertical.map(|code| format!("+{code}")).unwrap_or_default();
            format!("{name} (EPSG:{}{vertical})", codes.horizontal)
        }
        (Some(name), None) => name,
        (None, _) => text.to_owned(),
    }
}

fn depth(text: &str) -> usize {
    let (mut depth, mut deepest) = (0_usize, 0);
    for byte in text.bytes() {
        match byte {
            b'[' | b'(' => depth += 1,
            b']' | b')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    deepest
}

/// Returns the codes of the horizontal and the vertical system that a text describes.
fn epsg_codes(text: &str) -> Option<EpsgCodes> {
    let root = Node::parse(text)?;
    let parts: Vec<Node> = match root.keyword.to_ascii_uppercase().as_str() {
        "COMPD_CS" | "COMPOUNDCRS" => root.nodes().collect(),
        _ => vec![root],
    };
    let is_vertical = |node: &&Node| node.keyword.to_ascii_uppercase().starts_with("VERT");
    Some(EpsgCodes {
        horizontal: parts.iter().filter(|node| !is_vertical(node)).find_map(Node::epsg_code)?,
        vertical: parts.iter().filter(is_vertical).find_map(Node::epsg_code),
    })
}

/// A keyword with what stands in its brackets.
struct Node<'a> {
    keyword: &'a str,
    content: Vec<&'a str>,
}

impl<'a> Node<'a> {
    fn parse(text: &'a str) -> Option<Self> {
        let (keyword, rest) = text.trim().split_once(['[', '('])?;
        let content = split(rest.strip_suffix([']', ')'])?);
        Some(Self { keyword: keyword.trim(), content })
    }

    /// Returns the quoted text that stands first.
    fn name(&self) -> Option<&'a str> {
        self.content.first()?.trim().strip_prefix('"')?.strip_suffix('"')
    }

    /// Returns a system without a name in words.
    fn kind(&self) -> Option<String> {
        let keyword = self.keyword.to_ascii_uppercase();
        let kind = match keyword.as_str() {
            "PROJCS" | "PROJCRS" => "projected",
            "GEOGCS" | "GEOGCRS" => "geographic",
            "GEOCCS" => "geocentric",
            "GEODCRS" => "geodetic",
            "LOCAL_CS" | "ENGCRS" => "local",
            "COMPD_CS" | "COMPOUNDCRS" => "compound",
            _ => return None,
        };
        let projection = self.nodes().find(|node| node.keyword.eq_ignore_ascii_case("PROJECTION"));
        let projection = projection.and_then(|node| node.name()).map(|name| name.replace('_', " "));
        let words = projection.map_or_else(String::new, |projection| format!(", {projection}"));
        Some(format!("a {kind} system without a name{words}"))
    }

    fn nodes(&self) -> impl Iterator<Item = Node<'a>> {
        self.content
            .iter()
            .filter(|text| !text.trim().starts_with('"'))
            .filter_map(|t| Node::parse(t))
    }

    /// Returns the code of the node itself, not of what it is made of.
    fn epsg_code(&self) -> Option<u16> {
        let is_id = |node: &Node| {
            ["AUTHORITY", "ID"].map(str::to_owned).contains(&node.keyword.to_ascii_uppercase())
        };
        let id = self.nodes().find(is_id)?;
        let unquoted = |text: &&'a str| text.trim().trim_matches('"');
        match (id.content.first().map(unquoted), id.content.get(1).map(unquoted)) {
            (Some("EPSG"), Some(code)) => code.parse().ok(),
            _ => None,
        }
    }
}

/// Splits text at the commas that stand neither in brackets nor in quotes.
fn split(text: &str) -> Vec<&str> {
    let (mut depth, mut is_quoted) = (0_i32, false);
    let is_separator = |character: char| {
        match character {
            '"' => is_quoted = !is_quoted,
            '[' | '(' if !is_quoted => depth += 1,
            ']' | ')' if !is_quoted => depth -= 1,
            _ => {}
        }
        character == ',' && depth == 0 && !is_quoted
    };
    text.split(is_separator).collect()
}

#[cfg(test)]
mod tests {
    //! Codes and definitions of texts as scanners' software writes them.

    use super::*;

    const UTM: &str = r#"PROJCS["NAD83 / UTM zone 12N, metres",GEOGCS["NAD83",DATUM["North_American_Datum_1983",
        SPHEROID["GRS 1980",6378137,298.257222101,AUTHORITY["EPSG","7019"]],AUTHORITY["EPSG","6269"]],
        PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433],
        AUTHORITY["EPSG","4269"]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],
        PARAMETER["central_meridian",-111],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],
        PARAMETER["false_northing",0],UNIT["metre",1,AUTHORITY["EPSG","9001"]],AUTHORITY["EPSG","26912"]]"#;

    fn codes(horizontal: u16, vertical: Option<u16>) -> Option<EpsgCodes> {
        Some(EpsgCodes { horizontal, vertical })
    }

    #[test]
    fn codes_are_those_of_the_system_not_of_its_parts() {
        assert_eq!(definition(UTM).unwrap().1, codes(26912, None));
        let compound = format!(
            r#"COMPD_CS["both",{UTM},VERT_CS["NAVD88 height",VERT_DATUM["NAVD88",2005],
            UNIT["metre",1],AUTHORITY["EPSG","5703"]]]"#
        );
        let (words, found) = definition(&compound).unwrap();
        assert_eq!(found, codes(26912, Some(5703)));
        assert!(words.contains("+proj=tmerc") || words.contains("+proj=utm"), "{words}");
        let without = UTM.replace(r#",AUTHORITY["EPSG","26912"]"#, "");
        assert_eq!(definition(&without).unwrap().1, None);
    }

    #[test]
    fn names_are_those_of_the_system() {
        assert_eq!(short_name(UTM), "NAD83 / UTM zone 12N, metres (EPSG:26912)");
        assert_eq!(short_name("LOCAL_CS[\"site\",UNIT[\"metre\",1]]"), "site");
        assert_eq!(short_name("EPSG:2154+5720"), "EPSG:2154+5720");
        assert_eq!(short_name("GEOGCS[\"\"]"), "a geographic system without a name");
        let unnamed = UTM.replace("NAD83 / UTM zone 12N, metres", "unnamed");
        let expected = "a projected system without a name, Transverse Mercator (EPSG:26912)";
        assert_eq!(short_name(&unnamed), expected);
    }

    #[test]
    fn broken_and_deeply_nested_texts_are_refused() {
        for length in 0..UTM.len() {
            if UTM.is_char_boundary(length) {
                assert!(definition(&UTM[..length]).is_none(), "{length}");
            }
        }
        let nested = format!("{}1{}", "PROJCS[".repeat(20_000), "]".repeat(20_000));
        assert!(definition(&nested).is_none());
        for text in ["", "[", "]", "\"", "PROJCS[]", "PROJCS[\"a\"]", "GEOGCS[,,,]"] {
            assert!(definition(text).is_none(), "{text}");
        }
    }
}
