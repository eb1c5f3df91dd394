//! XML that ends early, closed after the last field of the last scan whose positions it describes.

use quick_xml::Reader;
use quick_xml::events::Event;

/// Maximum depth of elements; descriptions of scans have 6.
const MAX_DEPTH: usize = 64;

/// Fields that make a position.
const POSITIONS: [[&str; 3]; 2] = [
    ["cartesianX", "cartesianY", "cartesianZ"],
    ["sphericalRange", "sphericalAzimuth", "sphericalElevation"],
];

/// Returns the longest front of `xml` whose scans have the fields of positions, with its open elements closed; `None` if
/// it has no such scan. The last scan may lack fields.
pub(super) fn close(xml: &[u8]) -> Option<String> {
    let text = match std::str::from_utf8(xml) {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&xml[..error.valid_up_to()]).ok()?,
    };
    let mut reader = Reader::from_str(text);
    let mut path: Vec<String> = Vec::new();
    let (mut n_scans, mut fields) = (0, Vec::new());
    let mut closed = None;
    while let Ok(event) = reader.read_event() {
        match &event {
            Event::Start(start) | Event::Empty(start) if path.len() < MAX_DEPTH => {
                path.push(start.name().0.into());
            }
            Event::Start(_) | Event::Empty(_) | Event::Eof => break,
            _ => {}
        }
        if !matches!(event, Event::End(_) | Event::Empty(_)) {
            continue;
        }
        let names: Vec<&str> = path.iter().skip(1).map(String::as_str).collect();
        let is_whole = match *names {
            ["data3D", "vectorChild", "points", "prototype", field] => {
                let had_position = has_position(&fields);
                fields.push(field.to_owned());
                n_scans += u32::from(has_position(&fields) && !had_position);
                has_position(&fields)
            }
            ["data3D", "vectorChild"] => has_position(&std::mem::take(&mut fields)),
            ["data3D", "vectorChild", "points", "prototype"] | ["data3D", "vectorChild", _] => {
                has_position(&fields)
            }
            [_] | ["images2D", "vectorChild"] => true,
            _ => false,
        };
        path.pop();
        if is_whole && 0 < n_scans {
            closed = Some((reader.buffer_position() as usize, path.clone()));
        }
    }
    let (end, open) = closed?;
    let ends = open.iter().rev().map(|name| format!("</{name}>"));
    Some(text[..end].to_owned() + &ends.collect::<String>())
}

fn has_position(fields: &[String]) -> bool {
    let has = |name: &&str| fields.iter().any(|field| field == name);
    POSITIONS.iter().any(|names| names.iter().all(has))
}

#[cfg(test)]
mod tests {
    //! Descriptions cut between and within their elements.

    use super::close;

    const SCAN: &str = "<vectorChild><name>a</name><points><prototype><cartesianX/><cartesianY/><cartesianZ>1\
        </cartesianZ><i/></prototype></points><pose><w>1</w></pose></vectorChild>";

    #[test]
    fn xml_is_closed_after_whole_elements() {
        let xml = format!("<?xml version=\"1.0\"?><!-- > --><r a=\">\"><g/><data3D>{SCAN}{SCAN}");
        let first_end = xml.find(SCAN).unwrap() + SCAN.len();
        let until = |text: &str| first_end + SCAN.find(text).unwrap() + text.len();
        let whole = |end: usize| Some(xml[..end].to_owned() + "</data3D></r>");
        assert_eq!(close(xml.as_bytes()), whole(xml.len()));
        // Without the fields of a position the second scan is left out.
        let position = until("</cartesianZ>");
        for cut in
            [first_end, first_end + 5, until("</name>"), until("<cartesianY/>"), position - 1]
        {
            assert_eq!(close(&xml.as_bytes()[..cut]), whole(first_end), "{cut}");
        }
        let with = |end: usize, open: &str| {
            Some(format!("{}{open}</vectorChild></data3D></r>", &xml[..end]))
        };
        for (cut, fields) in [(position + 3, position), (position + 4, position + 4)] {
            assert_eq!(close(&xml.as_bytes()[..cut]), with(fields, "</prototype></points>"));
        }
        let fields = until("</prototype>");
        assert_eq!(close(&xml.as_bytes()[..fields + 3]), with(fields, "</points>"));
        // A pose is read whole or not at all.
        let points = until("</points>");
        assert_eq!(close(&xml.as_bytes()[..until("<w>1</w>")]), with(points, ""));
        let first_position = xml.find("</cartesianZ>").unwrap();
        assert_eq!(close(&xml.as_bytes()[..first_position]), None);
        assert_eq!(close(&[b"<a>".repeat(1000), vec![0xff]].concat()), None);
    }
}
