//! The ASPRS classes of objects.

pub const UNCLASSIFIED: u8 = 1;
pub const GROUND: u8 = 2;
pub const MEDIUM_VEGETATION: u8 = 4;
pub const HIGH_VEGETATION: u8 = 5;
pub const BUILDING: u8 = 6;
pub const WIRE_CONDUCTOR: u8 = 14;
pub const TRANSMISSION_TOWER: u8 = 15;
