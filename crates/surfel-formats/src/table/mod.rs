//! Points as tables of numbers: their roles and layout in a file, and their decoding into the columns of a cloud.

mod column_role;
mod column_choice;
mod color_range;
mod column_slices;
mod layout;
mod named_columns;
mod reader;
mod filtered_cloud;
mod cloud_builder;
mod line_end;
mod line_reader;
mod chunks;
mod encode;

pub use column_choice::{Column, ColumnChoice, TextColumn};

pub(crate) use chunks::{ParseFault, TextChunk, line_at, parse_chunks};
pub(crate) use cloud_builder::CloudBuilder;
pub(crate) use color_range::{ColorRange, is_byte};
pub(crate) use column_role::ColumnRole;
pub(crate) use column_slices::{ColumnSlices, resize_checked, shrink};
pub(crate) use encode::{
    POINTS_PER_CHUNK, decimal_step, encode_points, note_rounded_colors, scalar_word,
};
pub(crate) use filtered_cloud::FilteredCloud;
pub(crate) use layout::{ColumnField, Field, NumberType, RecordLayout};
pub(crate) use line_end::{FindEnd, find_line_end};
pub(crate) use line_reader::{
    LineError, MAX_FIELDS, MAX_LINE_LENGTH, RowRange, append_rows, parse_number, parse_numbers,
    read_rows, words_of,
};
pub(crate) use named_columns::named_columns;
pub(crate) use reader::{
    Tolerance, choose_origin, keep_matching, note_kept, origin_of_records, read_records,
    sample_positions,
};
