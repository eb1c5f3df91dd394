//! Settings that an object may have for itself: surface, preparation, colour.

use super::Invalid;
use super::clip_rule::{ClipBoxRule, ClipPlaneRule};
use super::color_rule::{ColorSourceRule, ColormapRule};
use super::crop::{Crop, CropRule};
use super::keys::{KeyedSettings, settings};
use super::point_filter::{Classes, RETURNS, Returns, point_filters};
use super::preparation_rule::{
    DENOISE, DUPLICATES, MIXED_PIXELS, NOISE_POINTS, RadiusRule, SubsampleRule, method_name,
    orientation_text,
};
use super::rule::{ColumnNames, Flag, Interval, OneOf, POSITIVE, Text, count, number, parsed};
use super::section::{Part, Section};
use serde_json::Value;
use surfel_core::image::Colormap;
use surfel_core::math::Vec3;
use surfel_core::points::neighbors::{NeighborMethod, Neighborhood};
use surfel_core::points::{
    COLUMN_INDEX, Denoise, Duplicates, GAUSSIAN_COLUMNS, MAX_REST_COLUMNS, MixedPixels,
    NoisePoints, Orientation, OutlierRemoval, POINT_SOURCE, PointFilter, Preparation, ROW_INDEX,
    Radius, SCAN_ANGLE, STRUCTURE, SURFACE_VARIATION, StructureChoice, Subsample, WITHHELD,
    rest_column,
};
use surfel_core::scene::color::{ColorSource, Coloring};
use surfel_core::scene::{Clip, ClipBox, ClipPlane};
use surfel_core::surface::{
    Align, EdgeTest, GatherLimit, OctreeDepth, SurfaceKind, SurfaceOptions,
};
use surfel_formats::{Column, ColumnChoice, LoadOptions, TextColumn};

/// Keys of the preparation that count while files are read.
pub const READ_ONCE: [&str; 5] = ["vertices", "columns", "salvage", "reproject", "animation_name"];

settings! {
    /// The shape that is given to points, and the part of an object that is shown.
    pub struct SurfaceSettings {
        /// Surface of the points: smooth, points, sphere, disc, splat-mean, splat, splat-fit, cylinder, mls, implicit, octree,
        /// octree-splat or gaussian, which is chosen for trained splats and needs them.
        surface: SurfaceKind = SurfaceKind::default(), parsed(|kind: &SurfaceKind| kind.name().to_owned()), "KIND", common;
        /// Edge of the surface: at the outermost points (angular-gap) or at the rims of their discs (off).
        edge_test: EdgeTest = EdgeTest::default(), parsed(|test: &EdgeTest| test.name().to_owned()), "TEST";
        /// Rule by which splat turns normals before it blends them: each (toward the viewer), nearest (to the side of the
        /// nearest disc) or both [default: both].
        align: Align, OneOf(&Align::ALL), "RULE";
        /// Discs that are blended: up to the least distance plus radius of all discs on the ray (least), or up to that of
        /// the nearest disc (nearest) [default: least].
        gather_limit: GatherLimit, OneOf(&GatherLimit::ALL), "RULE";
        /// Distance before which shadows, reflections and refractions ignore the surface, in radii. At 0 neighbouring discs
        /// shade each other [default: 2 for discs, 0.5 for smooth, implicit and mls].
        min_distance: f64, number(0.0, 100.0), "RADII";
        /// How far points count, in radii: from a ray for cylinder, from a position for mls, from a hit for splat-fit
        /// [default: 1, 1.4 and 2].
        reach: f64, number(0.25, 8.0), "RADII";
        /// Points that a hit of cylinder needs; a ray with fewer goes through a hole [default: 3].
        density: u32, count(1, 128), "COUNT";
        /// Degree of the polynomials of mls: 1 (planes), 2 or 3 [default: 2].
        degree: u32, count(1, 3), "DEGREE";
        /// Depth of the cells of octree and octree-splat: auto (as fine as the points, coarser where a pixel is larger) or
        /// a number of levels from 1 to 16.
        octree_depth: OctreeDepth = OctreeDepth::default(), parsed(OctreeDepth::to_string), "auto|N";
        /// Multiplies the radii of all points, those of the file and those estimated.
        radius_scale: f64 = 1.0, POSITIVE, "FACTOR";
        /// Hides what lies outside: ([x0,x1],[y0,y1],[z0,z1]) or x0,y0,z0,x1,y1,z1 in the file's own coordinates; two
        /// ranges have any height. What stays is prepared, coloured and framed as if nothing was hidden.
        clip_box: ClipBox, ClipBoxRule, "BOUNDS";
        /// Hides what lies beyond a plane, on the side to which its normal points.
        clip_plane: ClipPlane, ClipPlaneRule, "X,Y,Z,NX,NY,NZ";
    }
}

settings! {
    /// The reduction and completion of points before they become a surface.
    pub struct PreparationSettings {
        /// Keeps only points whose columns meet a condition, as in "classification == 2 && z < 1200" or
        /// "class != ground", or are in ranges of PDAL, as in "Classification![7:7],Z[0:100]"; surfel info lists the
        /// columns. Colours go from 0 to 255, or to 65535 where they are compared with a number above 255.
        filter: PointFilter, parsed(PointFilter::to_string), "CONDITION", common;
        /// Keeps only points of these ASPRS classes, as in 2,6 or ground,building. Without it, all but the classes of noise,
        /// 7 and 18, are kept.
        class: Vec<u8>, Classes, "CLASSES";
        /// Keeps only these returns of each laser pulse: first, last or only (those of pulses that have one).
        returns: Returns, OneOf(RETURNS), "WHICH";
        /// Keeps only points in an area, in the coordinates of their file: bounds as ([0,10],[0,10]), a POLYGON as
        /// well-known text, or a GeoJSON or WKT file of polygons. Other points take no memory, except in the viewer
        /// and in scenes of Python.
        crop: Crop, CropRule, "AREA";
        /// Points at exactly the same position with about the same normal: drop all but the first, or keep them
        /// [default: drop, keep for surfel prepare].
        duplicates: Duplicates, OneOf(DUPLICATES), "CHOICE";
        /// Points of classes of noise (7 and 18), those flagged withheld, and ten or more at exactly 0, 0, 0: drop or keep
        /// them [default: drop, keep for surfel prepare].
        noise_points: NoisePoints, OneOf(NOISE_POINTS), "CHOICE";
        /// Keeps fewer points: first:N, random:N, stride:S or spacing:LENGTH.
        subsample: Subsample, SubsampleRule, "CHOICE";
        /// Drops points that stand alone: statistical:K,RATIO, whose mean distance to K neighbours exceeds the mean of
        /// all by RATIO standard deviations (statistical alone: 16,2), or radius:DISTANCE,COUNT, with fewer than COUNT
        /// others (16) within DISTANCE.
        remove_outliers: OutlierRemoval, parsed(OutlierRemoval::to_string), "CHOICE";
        /// Moves noisy points onto their surface, and those of wires onto the axis of the wire: auto (surfaces whose noise is at
        /// least 0.15 of the spacing, and wires), on or off [default: auto, off for surfel prepare].
        denoise: Denoise, OneOf(DENOISE), "WHEN";
        /// Points in the air where the range of a scan jumps, as the grids of E57, PTX and PCD files tell: drop or keep
        /// them [default: drop, keep for surfel prepare].
        mixed_pixels: MixedPixels, OneOf(MIXED_PIXELS), "CHOICE";
        /// Search for neighbours: knn, grid or scan-line.
        neighbors: NeighborMethod = NeighborMethod::default(), parsed(method_name), "METHOD";
        /// Number of neighbours whose plane gives the normal. Where the surface bends, a cubic through 24 neighbours or
        /// more is used instead; noisier points use more [default: 16].
        normals_k: u32, count(2, 10_000), "K";
        /// Estimates normals from all neighbours within this distance in world units.
        normals_radius: f64, POSITIVE, "LENGTH";
        /// Front side of the surface: station (toward the scanner of each scan, of E57, PTX and PCD files), scan-angle
        /// (toward the scanner of an airborne survey), up (+Z), mst (outward), viewpoint:X,Y,Z, none, or auto: the
        /// first of station, scan-angle, up and mst that the file tells enough for. Where front sides are known, the
        /// back of a surface does not show through slits between the points [default: auto for surfel prepare and the
        /// colour normal, else station].
        orient: Orientation, parsed(orientation_text), "RULE";
        /// Radius of each point's surface: a length, adaptive[:K] (the distance to the K-th neighbour), curvature[:K]
        /// (less where the surface bends) or median[:N[,C]] (the median distance of C points, 100, to their 2N nearest)
        /// [default: that of the file, or adaptive:12].
        radius: Radius, RadiusRule, "RADIUS", common;
        /// Shape of each point by its neighbours: auto tells surfaces, lines (wires, poles) and scattered points
        /// (leaves) apart; surface treats all points as surface, scatter all as scattered. Radii of the file, a length and
        /// the median leave all points surface.
        structure: StructureChoice = StructureChoice::default(), parsed(StructureChoice::to_string), "CHOICE";
        /// Ends surfaces where a scanner saw through, as the grids of E57, PTX and PCD files tell [default: true, false
        /// where a filter or crop leaves points out].
        free_space: bool, Flag, "BOOL";
        /// Reads what is whole of a damaged LAS, LAZ, PLY, E57, PCD, PTX or text file, and reports how much that is.
        salvage: bool = false, Flag, "BOOL";
        /// Moves clouds whose coordinates are degrees of longitude and latitude to metres: to the coordinate system of
        /// the files before, or to their UTM zone [default: true, false for surfel prepare].
        reproject: bool, Flag, "BOOL";
        /// Takes the vertices of meshes as points.
        vertices: bool = false, Flag, "BOOL";
        /// Columns of a text file, as in x,y,z,-,r,g,b [default: found from the file].
        columns: String, ColumnNames, "NAMES";
        /// Plays the animation of this name of glTF files that have any [default: the first].
        animation_name: String, Text, "NAME";
    }
}

settings! {
    /// Colours of points.
    pub struct ColorSettings {
        /// Colour: rgb, intensity, elevation, class, normal, support (how near measured points are), the name of a
        /// column, #RRGGBB or a CSS colour name [default: chosen from the data].
        color: ColorSource, ColorSourceRule, "SOURCE", common;
        /// Colour map by its matplotlib name: viridis, turbo, gray, coolwarm_r ...
        /// [default: gray for intensity, viridis for everything else].
        cmap: Colormap, ColormapRule, "NAME";
        /// Values of the first and last colour of the map [default: the 2nd and 98th percentile, or 0,1 radii
        /// for support].
        range: (f64, f64), Interval, "LOW,HIGH";
        /// Brightens (above 1) or darkens colours of the file and values of the map, but not support
        /// [default: brightens dark colours of the file, and dark intensities if no map is named].
        gamma: f64, number(0.1, 10.0), "NUMBER";
    }
}

/// Settings of an object that take the place of the scene's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjectSettings {
    /// Shape of points, and the part that is shown.
    pub surface: SurfaceSettings,
    /// Preparation of points.
    pub preparation: PreparationSettings,
    /// Colours of points.
    pub color: ColorSettings,
}

impl ObjectSettings {
    /// Returns the settings as parts with their keys.
    pub fn parts(&self) -> [Part<&dyn KeyedSettings>; 3] {
        [
            Part { section: Section::Surface, prefix: "", settings: &self.surface },
            Part { section: Section::Preparation, prefix: "", settings: &self.preparation },
            Part { section: Section::Color, prefix: "", settings: &self.color },
        ]
    }

    /// Returns these settings, and those of `base` where they leave something open.
    #[must_use]
    pub fn over(&self, base: &Self) -> Self {
        let mut merged = base.clone();
        let own = &self.preparation;
        if own.normals_k.is_some() || own.normals_radius.is_some() {
            (merged.preparation.normals_k, merged.preparation.normals_radius) = (None, None);
        }
        merged.surface.overlay(&self.surface);
        merged.preparation.overlay(&self.preparation);
        merged.color.overlay(&self.color);
        merged
    }

    /// Returns the preparation of the library. `seed` decides what a random subsample keeps.
    pub fn preparation(&self, seed: u64) -> Preparation {
        let default = Preparation::default();
        let settings = &self.preparation;
        let within = settings.normals_radius.map(|radius| Neighborhood::Within(radius as f32));
        let nearest = settings.normals_k.map(|k| Neighborhood::Nearest(k as usize));
        Preparation {
            duplicates: settings.duplicates.unwrap_or(default.duplicates),
            noise_points: settings.noise_points.unwrap_or(default.noise_points),
            kept_noise: settings.class.clone().unwrap_or_default(),
            mixed_pixels: settings.mixed_pixels.unwrap_or(default.mixed_pixels),
            subsample: settings.subsample,
            remove_outliers: settings.remove_outliers,
            denoise: settings.denoise.unwrap_or(default.denoise),
            neighbors: settings.neighbors(),
            normals: within.or(nearest).unwrap_or(default.normals),
            estimates_normals: self.needs_normals(),
            orientation: self.orientation(),
            radii_from_normals: settings.radius.is_none(),
            radius: settings.radius.unwrap_or(default.radius),
            structure: if self.needs_structures() {
                settings.structure()
            } else {
                StructureChoice::Surface
            },
            // The rays of points that a filter left out say nothing.
            free_space: settings.free_space.unwrap_or(!settings.filters_points()),
            // A colour may ask for a column that only the preparation computes.
            keep_variation: matches!(&self.color.color, Some(ColorSource::Column(name)) if name == SURFACE_VARIATION),
            seed,
        }
    }

    /// Returns true if normals are estimated where the file has none: the surface, its colours or the settings need them.
    pub fn needs_normals(&self) -> bool {
        let settings = &self.preparation;
        let is_oriented = settings.orient.is_some_and(|rule| rule != Orientation::None);
        let is_bent = matches!(settings.radius, Some(Radius::Curvature { .. }));
        let is_chosen = settings.overrides_normals() || is_oriented || is_bent;
        let is_shown = matches!(self.color.color, Some(ColorSource::Normal | ColorSource::Support));
        self.needs_structures() || is_chosen || is_shown
    }

    /// Returns true if points may be lines and scatter. Spheres and pixels are what they are, and the planes of `SplatFit`
    /// are fitted to the points around a hit: these need no normals, which the directions of lines are.
    fn needs_structures(&self) -> bool {
        use SurfaceKind::{Points, Sphere, SplatFit};
        let is_structure = |name: &str| name == STRUCTURE;
        let is_shown =
            matches!(&self.color.color, Some(ColorSource::Column(name)) if is_structure(name));
        let is_chosen = self.preparation.structure.is_some_and(|of| of != StructureChoice::Surface);
        let has_planes = !matches!(self.surface.surface(), Points | Sphere | SplatFit);
        has_planes || is_chosen || is_shown
    }

    /// Returns the columns that only the preparation needs: what the scanner tells of each point.
    pub fn columns_of_preparation(&self) -> Vec<&'static str> {
        let mut columns = Vec::new();
        let settings = &self.preparation;
        if settings.free_space != Some(false) || settings.mixed_pixels != Some(MixedPixels::Keep) {
            columns.extend([ROW_INDEX, COLUMN_INDEX]);
        }
        if matches!(self.orientation(), Orientation::Auto | Orientation::ScanAngle) {
            columns.extend([SCAN_ANGLE, POINT_SOURCE]);
        }
        let is_shown = |name: &str| matches!(&self.color.color, Some(ColorSource::Column(shown)) if shown == name);
        columns.retain(|name| !is_shown(name));
        columns
    }

    /// Returns the orientation of normals. By stations it takes no time; a picture depends on another one only where it
    /// shows normals as colours, or where slits are to be closed.
    fn orientation(&self) -> Orientation {
        let default = match self.color.color {
            Some(ColorSource::Normal) => Orientation::Auto,
            _ => Orientation::Station,
        };
        self.preparation.orient.unwrap_or(default)
    }

    /// Returns the colouring of the library; elevations count along `up`.
    pub fn coloring(&self, up: Vec3) -> Coloring {
        let ColorSettings { color, cmap, range, gamma } = self.color.clone();
        Coloring { source: color, colormap: cmap, range, gamma, up }
    }

    /// Returns the columns of trained splats that a picture with these settings needs if a file has them.
    fn gaussian_columns(&self) -> impl Iterator<Item = String> {
        let may_be_gaussian =
            self.surface.surface.is_none_or(|surface| surface == SurfaceKind::Gaussian);
        let shows_colors = matches!(self.color.color, None | Some(ColorSource::Rgb));
        let n_rest = if shows_colors { MAX_REST_COLUMNS } else { 0 };
        let names = GAUSSIAN_COLUMNS.into_iter().map(str::to_owned);
        names.chain((0..n_rest).map(rest_column)).filter(move |_| may_be_gaussian)
    }

    /// Returns the columns that a picture with these settings needs.
    pub fn columns(&self) -> ColumnChoice {
        let mut columns = self.preparation.kept_columns();
        let of_preparation = self.columns_of_preparation();
        columns.extend(of_preparation.iter().map(|name| Column::Scalar((*name).to_owned())));
        columns.extend(self.gaussian_columns().map(Column::Scalar));
        match &self.color.color {
            None => columns.extend([Column::Colors, Column::Intensity]),
            Some(ColorSource::Rgb) => columns.push(Column::Colors),
            Some(ColorSource::Intensity) => columns.push(Column::Intensity),
            Some(ColorSource::Class) => {
                columns.extend([Column::Classification, Column::Scalar("class".to_owned())]);
            }
            Some(ColorSource::Column(name)) => columns.push(Column::Scalar(name.clone())),
            Some(
                ColorSource::Elevation
                | ColorSource::Normal
                | ColorSource::Support
                | ColorSource::Constant(_),
            ) => {}
        }
        ColumnChoice::Only(columns)
    }
}

impl SurfaceSettings {
    /// Returns the options of the surface.
    pub fn options(&self) -> SurfaceOptions {
        let default = SurfaceOptions::default();
        SurfaceOptions {
            align: self.align.unwrap_or_default(),
            gather_limit: self.gather_limit.unwrap_or_default(),
            min_distance: self.min_distance.map(|distance| distance as f32),
            reach: self.reach.map(|reach| reach as f32),
            density: self.density.unwrap_or(default.density),
            degree: self.degree.unwrap_or(default.degree),
        }
    }

    /// Returns the part of the scene that is shown.
    pub fn clip(&self) -> Clip {
        Clip { bounds: self.clip_box, plane: self.clip_plane }
    }
}

impl PreparationSettings {
    /// Returns options of a reader that keeps these columns, and the points that the filter keeps.
    ///
    /// # Errors
    ///
    /// Fails if the file of the area that is kept has no polygons.
    pub fn load_options(&self, columns: ColumnChoice) -> Result<LoadOptions, Invalid> {
        let text_columns = self.columns.as_deref().map(TextColumn::parse_list);
        let animation = self.animation_name.clone();
        Ok(LoadOptions {
            columns,
            text_columns,
            filter: self.point_filter()?,
            salvage: self.salvage(),
            animation,
            ..LoadOptions::default()
        })
    }

    /// Returns the filter that `filter`, `class`, `returns` and `crop` make together; `None` if all points are kept.
    ///
    /// # Errors
    ///
    /// Fails if the file of the area that is kept has no polygons.
    pub fn point_filter(&self) -> Result<Option<PointFilter>, Invalid> {
        let filters = self.point_filters()?.into_iter().map(|(_, filter)| filter);
        let filters: Vec<PointFilter> = filters.collect();
        Ok((!filters.is_empty()).then(|| PointFilter::all(filters)))
    }

    /// Returns the filters that the settings make, each with the key of its setting.
    ///
    /// # Errors
    ///
    /// Fails if the file of the area that is kept has no polygons.
    pub fn point_filters(&self) -> Result<Vec<(&'static str, PointFilter)>, Invalid> {
        let area = self.crop.as_ref().map(Crop::filter).transpose()?;
        Ok(point_filters(self.filter.as_ref(), self.class.as_deref(), self.returns, area))
    }

    /// Returns true if not all points are kept.
    pub fn filters_points(&self) -> bool {
        let by_column = self.filter.is_some() || self.class.is_some() || self.returns.is_some();
        by_column || self.crop.is_some()
    }

    /// Returns the values of the settings that say which points are kept.
    pub(crate) fn filter_values(&self) -> Value {
        ["filter", "class", "returns", "crop"].map(|key| self.get(key)).into_iter().collect()
    }

    /// Returns true if files are read alike under other settings.
    pub fn reads_like(&self, other: &Self) -> bool {
        READ_ONCE.iter().all(|key| self.get(key) == other.get(key))
    }

    /// Returns true if the settings say how normals are estimated.
    pub fn overrides_normals(&self) -> bool {
        self.normals_k.is_some() || self.normals_radius.is_some()
    }

    /// Returns true if the settings or the stations say which side of the surface is its front.
    pub fn knows_front_sides(&self, has_stations: bool) -> bool {
        match self.orient {
            None | Some(Orientation::Station) => has_stations,
            Some(orientation) => orientation != Orientation::None,
        }
    }

    /// Returns true if normals point out of what the points enclose.
    pub fn orients_outward(&self) -> bool {
        self.orient == Some(Orientation::SpanningTree)
    }

    /// Returns the columns of a surface that are not to be estimated.
    pub fn kept_columns(&self) -> Vec<Column> {
        let normals = (!self.overrides_normals()).then_some(Column::Normals);
        let radii = self.radius.is_none().then_some(Column::Radii);
        let structure = self.radius.is_none().then(|| Column::Scalar(STRUCTURE.to_owned()));
        // Points of classes of noise, and those flagged withheld, are left out.
        let of_cleaning = [Column::Classification, Column::Scalar(WITHHELD.to_owned())];
        normals.into_iter().chain(radii).chain(structure).chain(of_cleaning).collect()
    }

    /// Drops the normals and radii that are to be estimated.
    pub fn drop_estimated(&self, cloud: &mut surfel_core::points::PointCloud) {
        if self.overrides_normals() {
            cloud.normals = None;
        }
        if self.radius.is_some() {
            cloud.radii = None;
        }
    }
}
