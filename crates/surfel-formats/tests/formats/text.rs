//! Text files: separators, headers, inferred columns and limits.

use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, Loaded, TextColumn, load_bytes};

use crate::common::{Listener, read};

#[test]
fn separators_comments_and_headers_are_recognised() {
    let files = [
        "1 2 3\n4 5 6",
        "1\t2\t3\r\n4\t5\t6\r\n",
        "# made by hand\n1, 2, 3,\n// more\n4, 5, 6,\n",
        "\u{feff}X;Y;Z\n1;2;3\n4;5;6\n",
        "\u{feff}1 2 3\n4 5 6\n",
        "//X Y Z\n1 2 3\n\n4 5 6\n",
        "\"x\",\"y\",\"z\"\n1,2,3\n4,5,6\n",
        "2\n1 2 3\n4 5 6\n",
    ];
    for file in files {
        let cloud = read("a.txt", file).unwrap().cloud;
        let expected = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
        assert_eq!(cloud.positions, expected, "{file:?}");
        assert!(cloud.scalars.is_empty(), "{file:?}");
    }
}

#[test]
fn headers_name_columns() {
    let file = "x,y,z,R,G,B,Alpha,Intensity,nx,ny,nz,Class,GPS time\n\
        1,2,3,10,20,30,255,0.5,0,0,2,6,123.25\n1,2,3,10,20,30,255,,0,1,0,2,124\n";
    let cloud = read("a.csv", file).unwrap().cloud;
    assert_eq!(cloud.colors.as_ref().unwrap()[0], [10 * 257, 20 * 257, 30 * 257]);
    // The lengths of normals may be radii.
    assert_eq!(cloud.normals.as_ref().unwrap()[..], [2.0 * Vec3::Z, Vec3::Y]);
    assert_eq!(cloud.classification, Some(vec![6, 2]));
    assert_eq!(cloud.scalar("gps time").unwrap().get(0), 123.25);
    assert!(cloud.intensity.unwrap()[1].is_nan(), "an empty field is not a number");
}

#[test]
fn a_second_column_of_a_role_becomes_a_scalar() {
    for file in ["x,y,z,height\n1,2,3,4\n", "x,y,height,z\n1,2,4,3\n"] {
        let cloud = read("a.csv", file).unwrap().cloud;
        assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0)], "{file}");
        assert_eq!(cloud.scalar("height").unwrap().get(0), 4.0, "{file}");
    }
    let heights = read("a.csv", "x,y,height\n1,2,4\n").unwrap().cloud;
    assert_eq!(heights.positions, [Vec3::new(1.0, 2.0, 4.0)]);
    let columns = TextColumn::parse_list("x,y,-,height,z");
    let options = LoadOptions { text_columns: Some(columns), ..LoadOptions::default() };
    let stated = load_bytes("a.txt", b"1 2 9 4 3\n", &options, &Listener::default()).unwrap().cloud;
    assert_eq!(stated.positions, [Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(stated.scalar("height").unwrap().get(0), 4.0);
}

#[test]
fn comments_are_headers_only_if_they_fit_the_data() {
    for remark in ["# Columns: X Y Z", "# x y z in metres", "// x y"] {
        let cloud = read("a.xyz", format!("{remark}\n1 2 3\n4 5 6\n")).unwrap().cloud;
        assert_eq!(cloud.len(), 2, "{remark}");
        assert!(cloud.scalars.is_empty(), "{remark}");
    }
    let header = read("a.xyz", "# x y z time\n1 2 3 4\n").unwrap().cloud;
    assert_eq!(header.scalar("time").unwrap().get(0), 4.0);
    let both = read("a.csv", "x,y,z,time\n# z x y quality\n1,2,3,4\n").unwrap().cloud;
    assert_eq!(both.scalar("time").unwrap().get(0), 4.0);
}

#[test]
fn columns_are_inferred_and_reported() {
    let guess = |line: &str| {
        let listener = Listener::default();
        let options = LoadOptions::default();
        let cloud = load_bytes("a.xyz", line.as_bytes(), &options, &listener).unwrap().cloud;
        assert!(listener.has_note("columns taken as x y z"), "{line}");
        cloud
    };
    assert_eq!(guess("1 2 3 0.5").intensity, Some(vec![0.5]));
    assert_eq!(guess("1 2 3 0 128 255").colors, Some(vec![[0, 128 * 257, 65535]]));
    assert_eq!(guess("1 2 3 0 -1 0").normals, Some(vec![-Vec3::Y]));
    assert_eq!(guess("1 2 3 0.6 0 0.8").normals, Some(vec![Vec3::new(0.6, 0.0, 0.8)]));
    assert_eq!(guess("1 2 3 0.2 1 0").colors, Some(vec![[13107, 65535, 0]]));
    let floor = guess("1 2 3 0 0 1\n2 2 3 0 0 1");
    assert_eq!((floor.normals, floor.colors), (Some(vec![Vec3::Z; 2]), None));
    let mixed = guess("1 2 3 0 0 1 0 0 255\n2 2 3 1 0 0 9 9 9");
    assert_eq!(mixed.normals, Some(vec![Vec3::Z, Vec3::X]));
    assert_eq!(mixed.colors.unwrap()[0], [0, 0, 65535]);
    assert!(guess("1 2 3 0 0 1\n2 2 3 0 0 2").colors.is_some());
    let pts = guess("1 2 3 -700 1 2 3");
    assert_eq!((pts.intensity, pts.colors), (Some(vec![-700.0]), Some(vec![[257, 514, 771]])));
    let behind = guess("1 2 3 1 2 3 0.5");
    assert_eq!((behind.intensity, behind.colors), (Some(vec![0.5]), Some(vec![[257, 514, 771]])));
    assert_eq!(guess("1 2 3 4 5").scalars.len(), 2);
}

#[test]
fn three_further_columns_are_normals_only_if_their_values_can_be() {
    let cloud_of = |lines: &str| read("a.xyz", lines).unwrap().cloud;
    // Colours of 16 bits, and of 8 bits before a class or further columns.
    let words = cloud_of("1 2 3 41216 38656 30208\n2 2 3 41000 256 0\n3 2 3 0 0 299\n");
    assert_eq!(words.colors.map(|colors| colors[1]), Some([41000, 256, 0]));
    let class = cloud_of("1 2 3 200 180 160 12.000000\n1 2 4 90 88 80 2.000000\n");
    assert_eq!(class.colors.map(|colors| colors[0]), Some([200, 180, 160].map(|v| v * 257)));
    assert_eq!(class.intensity, Some(vec![12.0, 2.0]));
    let pts = read("a.pts", "1 2 3 200 180 160 12\n").unwrap().cloud;
    assert_eq!(pts.intensity, Some(vec![200.0]));
    for lines in ["1 2 3 200 180 160 812 2\n", "1 2 3 200 180 160 812 1 2\n"] {
        let cloud = cloud_of(lines);
        assert_eq!(cloud.scalar("column 7").unwrap().get(0), 812.0, "{lines}");
        assert_eq!(cloud.colors.map(|colors| colors[0][0]), Some(200 * 257), "{lines}");
        assert_eq!(cloud.normals, None, "{lines}");
    }
    // Intensity, return and number of returns.
    let returns = cloud_of("1 2 3 812 1 2\n1 2 3 1300 1 1\n");
    assert_eq!((returns.colors, returns.normals, returns.scalars.len()), (None, None, 3));
    // Normals whose lengths are radii, and missing ones.
    let radii = cloud_of("10 0 0 0.5 -0.2 0\n0 10 0 0.1 0.3 0.2\n");
    assert_eq!(radii.normals.map(|normals| normals.len()), Some(2));
    let missing = cloud_of("1 2 3 0 0 0\n1 2 3 0.6 0 0.8\n");
    assert_eq!(missing.normals.map(|normals| normals[1]), Some(Vec3::new(0.6, 0.0, 0.8)));
}

#[test]
fn a_first_column_that_numbers_the_points_is_skipped() {
    let cloud_of = |first: fn(usize) -> usize| {
        let lines = (0..200).map(|i| format!("{} 7 8 {i}\n", first(i)));
        read("a.txt", lines.collect::<String>()).unwrap().cloud
    };
    let numbered = cloud_of(|i| i + 1);
    let position = numbered.world_position(3);
    assert_eq!((position, numbered.intensity), (DVec3::new(7.0, 8.0, 3.0), None));
    let lines = (0..200).map(|i| format!("{} 7 8 {i} 200 180 160\n", i + 1));
    let colored = read("a.txt", lines.collect::<String>()).unwrap().cloud;
    assert_eq!(colored.world_position(3), DVec3::new(7.0, 8.0, 3.0));
    assert_eq!(colored.colors.map(|colors| colors[0]), Some([200, 180, 160].map(|v| v * 257)));
    // The first column of a grid of points starts again with each row.
    let grid = cloud_of(|i| i % 20);
    assert_eq!(grid.world_position(3), DVec3::new(3.0, 7.0, 8.0));
    assert_eq!(grid.intensity.map(|intensity| intensity[3]), Some(3.0));
}

#[test]
fn text_in_utf_16_is_refused_by_name() {
    for mark in [[0xff, 0xfe], [0xfe, 0xff]] {
        let file = [&mark[..], b"1\x00 \x002\x00"].concat();
        let error = load_bytes("a.txt", &file, &LoadOptions::default(), &Listener::default());
        let message = error.unwrap_err().to_string();
        assert!(
            message.contains("text in UTF-16") && message.contains("save it as UTF-8"),
            "{message}"
        );
    }
}

#[test]
fn stated_columns_override_inference() {
    let columns = TextColumn::parse_list("intensity,-,x,y,z,quality");
    let options = LoadOptions { text_columns: Some(columns), ..LoadOptions::default() };
    let file = b"7 what 1 2 3 0.5\n8 ever 4 5 6 0.25\n";
    // The first line needs a header because the later lines are not all numeric.
    let file = [b"# intensity word x y z quality\n".as_slice(), b"7 0 1 2 3 0.5\n", file].concat();
    let cloud = load_bytes("a.txt", &file, &options, &Listener::default()).unwrap().cloud;
    assert_eq!(cloud.len(), 3);
    assert_eq!(cloud.intensity, Some(vec![7.0, 7.0, 8.0]));
    assert_eq!(cloud.scalar("quality").unwrap().get(2), 0.25);
}

#[test]
fn large_coordinates_keep_their_precision() {
    let file = "500000.123 4900000.456 100.5\n500010.123 4900010.456 101.5\n";
    let cloud = read("a.xyz", file).unwrap().cloud;
    let expected = DVec3::new(500_010.123, 4_900_010.456, 101.5);
    assert!((cloud.world_position(1) - expected).abs().max_element() < 1e-6);
}

#[test]
fn invalid_lines_are_errors_with_a_line_number() {
    let message = |file: &str| read("a.xyz", file).unwrap_err().to_string();
    assert_eq!(
        message("1 2 3\n4 5\n"),
        "a.xyz: line 2: found 2 fields, expected 3 as in the lines before; repair or remove the line; \
         what is whole can be read [salvage]"
    );
    assert!(message("1 2 3\n# c\n\n4 x 6\n").contains("line 4: found `x`, expected a number"));
    assert!(message("1,2,3\n1,5;2,5;3,5\n").contains("`5;2`, expected a number"));
    assert!(message("1 2\n3 4\n").contains("2 columns without z"));
    assert!(message("hello world\n").contains("expected numbers, or a header"));
    assert!(message("# only words\n").contains("no line with numbers"));
    let long = "1 2 3\n".repeat(200_000) + "1 2\n" + &"1 2 3\n".repeat(100_000);
    assert!(message(&long).contains("line 200001:"), "{}", message(&long));
}

/// Returns a file, and its cloud with the notes that reading it gave.
fn survey(file: &str) -> (PointCloud, Listener) {
    let listener = Listener::default();
    let options = LoadOptions::default();
    let loaded = load_bytes("survey.csv", file.as_bytes(), &options, &listener);
    (loaded.unwrap_or_else(|error| panic!("{file}: {error}")).cloud, listener)
}

#[test]
fn axes_of_survey_points_are_known_in_any_order() {
    let files = [
        "PtName,E,N,H,Code\nP1,10,20,3,TREE\n",
        "Pt,N,E,H,Code\nP1,20,10,3,TREE\n",
        "Pt,Easting,Northing,Elevation,Description\nP1,10,20,3,\"oak; tall, old\"\n",
        "Pt,Northing,Easting,Elevation\nP1,20,10,3\n",
        "Punktnummer;Rechtswert;Hochwert;H\u{f6}he\nP1;10,0;20,0;3,0\n",
        "Name\tEast\tNorth\tElev\nP1\t10\t20\t3\n",
        "id,latitude,longitude,altitude\nP1,20,10,3\n",
        "\"pt no\";\"e\";\"n\";\"z\"\n\"P 1\";\"10\";\"20\";\"3\"\n",
    ];
    for file in files {
        let (cloud, listener) = survey(file);
        assert_eq!(cloud.positions, [Vec3::new(10.0, 20.0, 3.0)], "{file}");
        assert!(cloud.scalars.is_empty(), "{file}");
        assert!(listener.has_note("survey.csv: skipped text column"), "{file}");
    }
    let (cloud, _) = survey("x,y,z,n,h\n1,2,3,4,5\n");
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!((cloud.scalars[0].name.as_str(), cloud.scalars[1].name.as_str()), ("n", "h"));
}

#[test]
fn longitudes_and_latitudes_are_degrees() {
    let system = |file: &str| {
        let options = LoadOptions::default();
        let loaded = load_bytes("track.csv", file.as_bytes(), &options, &NoProgress).unwrap();
        loaded.info.coordinate_system
    };
    assert_eq!(system("lat,lon,alt\n48,11,520\n").as_deref(), Some("EPSG:4326"));
    assert_eq!(system("x,y,z,lat,lon\n1,2,3,48,11\n"), None);
}

#[test]
fn text_columns_are_skipped_and_named() {
    let (cloud, listener) = survey("Pt,E,N,H,Code,Quality\n1,1,2,3,TREE,0.5\nA2,4,5,6,,0.25\n");
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    assert!(listener.has_note("survey.csv: skipped text columns Pt, Code"));
    assert_eq!(cloud.scalars.len(), 1);
    assert_eq!(cloud.scalar("quality").unwrap().get(1), 0.25);
}

#[test]
fn columns_may_be_stated_for_more_fields_than_the_header_names() {
    let file = "x,y,z\n1,2,3,TREE\n4,5,6,OAK\n";
    let columns = Some(TextColumn::parse_list("x,y,z,class"));
    let options = LoadOptions { text_columns: columns, ..LoadOptions::default() };
    let listener = Listener::default();
    let cloud = load_bytes("a.csv", file.as_bytes(), &options, &listener).unwrap().cloud;
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    assert!(listener.has_note("skipped text column classification"), "{:?}", listener.notes);
}

#[test]
fn text_without_a_header_needs_stated_columns() {
    let file = "20,10,3,TREE\n21,11,3,\"a, b\"\n";
    let error = read("a.csv", file).unwrap_err().to_string();
    assert!(error.contains("line 1: found `20,10,3,TREE`"), "{error}");
    assert!(error.contains("state the columns, as in x,y,z,- or, if"), "{error}");
    for (line, expected) in [
        ("20,10,3,TREE", ["x,y,z,-", "y,x,z,-"]),
        ("1,20,10,3,TREE", ["-,x,y,z,-", "-,y,x,z,-"]),
        ("P1 20 10 3", ["-,x,y,z", "-,y,x,z"]),
    ] {
        let error = read("a.csv", format!("{line}\n{line}\n")).unwrap_err().to_string();
        let [easting_first, northing_first] = expected;
        let advice =
            format!("as in {easting_first} or, if the northing comes first, {northing_first};");
        assert!(error.contains(&advice), "{error}");
    }
}

/// A list of a survey without a header.
const SURVEY: &str = "P1,20,10,3,TREE\nP2,21,11,3,\"a, b\"\n";

#[test]
fn lists_of_names_coordinates_and_codes_need_no_header() {
    for file in [SURVEY, "P1;20;10;3;TREE;oak\n2;21;11;3;;\n", "P1 20 10 3 TREE\nP2 21 11 3 9\n"] {
        let listener = Listener::default();
        let loaded = load_bytes("a.csv", file.as_bytes(), &LoadOptions::default(), &listener);
        let cloud = loaded.unwrap().cloud;
        assert_eq!(cloud.positions, [Vec3::new(20.0, 10.0, 3.0), Vec3::new(21.0, 11.0, 3.0)]);
        assert!(cloud.scalars.is_empty() && cloud.intensity.is_none());
        let line = "columns taken as name of the point, x y z, code; -,y,x,z,-";
        assert!(listener.has_note(line), "{:?}", listener.notes);
    }
    // A text among the coordinates, or a number among the codes, leaves it open what is what.
    for file in ["P1,20,10,3,TREE,5\n", "P1,20,TREE,10,3\n", "P1,20,10,3,TREE\nP2,20,x,3,TREE\n"] {
        assert!(read("a.csv", file).is_err(), "{file}");
    }
}

#[test]
fn northings_come_first_if_stated() {
    let columns = Some(TextColumn::parse_list("-,y,x,z,code"));
    let options = LoadOptions { text_columns: columns, ..LoadOptions::default() };
    let listener = Listener::default();
    let cloud = load_bytes("a.csv", SURVEY.as_bytes(), &options, &listener).unwrap().cloud;
    assert_eq!(cloud.positions[1], Vec3::new(11.0, 21.0, 3.0));
    assert!(listener.has_note("skipped text column code"));
}

#[test]
fn texts_in_place_of_coordinates_and_colours_are_errors() {
    for file in ["x,y,z\n1,2,3\n1,two,3\n", "x,y,z,r,g,b\n1,2,3,1,1,1\n1,2,3,1,x,1\n"] {
        let error = read("a.csv", file).unwrap_err().to_string();
        assert!(error.contains("line 3: found `") && error.contains("a number"), "{error}");
    }
}

#[test]
fn obj_vertices_are_read_with_their_colours() {
    let plain = "# cube\nmtllib a\nv 1 2 3\nvn 0 0 1\nvt 0 0\nv 4 5 6 1.0\nf 1 2 1\n";
    let cloud = read("a.obj", plain).unwrap().cloud;
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    let colored = read("a.obj", "v 1 2 3 0 0.5 1\nv 1 2 3 1 1 1\n").unwrap().cloud;
    assert_eq!(colored.colors.unwrap()[0], [0, 32768, 65535]);
    let mixed = "v 1 2 3 # a corner\nv 4 \\\n5 6 1 \\\r\n0 0 # red\nv 7 8 9 1.0\n";
    let cloud = read("a.obj", mixed).unwrap().cloud;
    let positions = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]];
    assert_eq!(cloud.positions, positions.map(Vec3::from_array));
    assert_eq!(cloud.colors, Some(vec![[0; 3], [65535, 0, 0], [0; 3]]));
    let error = read("a.obj", "v 1 \\\n2 3\nv 1 \\\n2\nv 1 2 3\n").unwrap_err().to_string();
    assert!(error.contains("line 3: found 2 numbers"), "{error}");
    let error = read("a.obj", "v 1 2 3\nv 1 2\n").unwrap_err().to_string();
    assert!(error.contains("line 2: found 2 numbers"), "{error}");
}

#[test]
fn names_may_have_units_and_tabs_may_separate_texts() {
    let text = "Easting [m]\tNorthing [m]\tHeight [m]\tPoint name\n1\t2\t3\toak tree\n4\t5\t6\t\n";
    let Loaded { cloud, info } = read("a.txt", text.as_bytes()).unwrap();
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    assert_eq!(info.format, "text, 4 columns separated by tabs");
    let gaps = "X (m)\tY (m)\tZ (m)\tintensity\n1\t2\t3\t\n4\t5\t6\t7\n";
    let cloud = read("a.txt", gaps.as_bytes()).unwrap().cloud;
    let intensity = cloud.intensity.unwrap();
    assert!(intensity[0].is_nan() && intensity[1] == 7.0, "{intensity:?}");
    let error = read("a.txt", b"X (m)\tY (m)\tZ (m)\n1\t2\n").unwrap_err().to_string();
    assert!(error.contains("line 2"), "{error}");
    let german = "x,y,z,Rot,Gr\u{fc}n,Blau\n1,2,3,255,128,0\n";
    let colors = read("a.csv", german.as_bytes()).unwrap().cloud.colors;
    assert_eq!(colors, Some(vec![[65_535, 128 * 257, 0]]));
}

#[test]
fn lines_may_lack_fields_only_in_proportion_to_their_length() {
    let file = |n_columns: usize| {
        let more: String = (3..n_columns).map(|i| format!("\tcolumn {i}")).collect();
        format!("x (m)\ty (m)\tz (m){more}\n{}", "1\t2\t3\n".repeat(3))
    };
    let cloud = read("a.txt", file(40)).unwrap().cloud;
    assert_eq!((cloud.len(), cloud.scalars.len()), (3, 37));
    assert!(cloud.scalars[36].values.get(2).is_nan());
    let error = read("a.txt", file(1000)).unwrap_err().to_string();
    assert!(error.contains("line 2: found 3 fields, expected 1000 as in"), "{error}");
}

#[test]
fn a_list_behind_the_columns_is_not_read() {
    let file = "# 3D point list with one line of data per point:\n\
        #   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n\
        # Number of points: 2, mean track length: 2.5\n\
        63390 1.5 0.25 0.5 115 121 122 1.34 16 6542 15 7345\n7 2 3 4 1 2 3 0.5 16 6542\n";
    let cloud = read("points3D.txt", file).unwrap().cloud;
    assert_eq!(cloud.positions, [Vec3::new(1.5, 0.25, 0.5), Vec3::new(2.0, 3.0, 4.0)]);
    assert_eq!(cloud.colors.as_ref().unwrap()[1], [257, 514, 771]);
    assert_eq!(cloud.scalar("ERROR").unwrap().get(0), 1.34);
    let short = read("points3D.txt", file.replace("7 2 3 4 1 2 3 0.5 16 6542", "7 2 3 4 1 2"));
    assert!(short.map(|_| ()).unwrap_err().to_string().contains("6 fields, expected 8"));
}

#[test]
fn decimal_commas_between_blanks_are_read() {
    for file in ["1,5\t2,25\t-3,5\n4\t5\t6\n", "X Y Z\n1,5 2,25 -3,5\n4 5 6\n"] {
        let cloud = read("a.txt", file).unwrap().cloud;
        assert_eq!(cloud.positions, [Vec3::new(1.5, 2.25, -3.5), Vec3::new(4.0, 5.0, 6.0)]);
    }
}

#[test]
fn words_for_missing_numbers_are_read() {
    let file = "X,Y,Z,Intensity,Dist\n1,2,3,NA,0.5\n4,5,6,7,-nan(ind)\n7,8,9,null,N/A\n";
    let cloud = read("a.csv", file).unwrap().cloud;
    let intensity = cloud.intensity.as_ref().unwrap();
    assert!(intensity[0].is_nan() && intensity[1] == 7.0 && intensity[2].is_nan());
    let distances = cloud.scalar("Dist").unwrap();
    assert!(distances.get(0) == 0.5 && distances.get(1).is_nan() && distances.get(2).is_nan());
}

#[test]
fn float_colours_of_cloudcompare_are_colours() {
    let cloud = read("a.txt", "//X Y Z Rf Gf Bf Af\n1 2 3 0.8 0.2 1 0.5\n").unwrap().cloud;
    assert_eq!(cloud.colors, Some(vec![[52428, 13107, 65535]]));
    assert!(cloud.scalars.is_empty());
}
