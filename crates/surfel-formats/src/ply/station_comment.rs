//! Stations of scans in comments of PLY headers, which other programs ignore: `comment station`, position, rotation as a
//! quaternion x y z w, rows and columns of the grid, name. A position that is not known is NaN, no grid 0 0.

use surfel_core::math::{DQuat, DVec3};
use surfel_core::points::ScanStation;

/// Number of words before the name.
const N_WORDS: usize = 11;

/// Returns the line of a header that states a station, without its end.
pub(super) fn format_station(station: &ScanStation) -> String {
    let [x, y, z] = station.position.unwrap_or(DVec3::NAN).to_array();
    let [qx, qy, qz, qw] = station.rotation.to_array();
    let [rows, columns] = station.grid.unwrap_or_default();
    let name = station.name.replace(char::is_control, " ");
    format!("comment station {x} {y} {z} {qx} {qy} {qz} {qw} {rows} {columns} {name}")
}

/// Returns the station that the words of a line state; `None` for all other comments.
pub(super) fn parse_station(words: &[&str]) -> Option<ScanStation> {
    let (stated, name) = words.split_at_checked(N_WORDS)?;
    let ["comment", "station", pose @ .., rows, columns] = stated else { return None };
    let pose: Vec<f64> = pose.iter().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    let (position, rotation) = pose.split_first_chunk()?;
    let rotation = DQuat::from_array(*rotation.first_chunk()?);
    let grid = [rows.parse().ok()?, columns.parse().ok()?];
    Some(ScanStation {
        name: name.join(" "),
        position: Some(DVec3::from_array(*position)).filter(|position| position.is_finite()),
        rotation: if rotation.is_normalized() { rotation } else { DQuat::IDENTITY },
        grid: (grid != [0, 0]).then_some(grid),
    })
}
