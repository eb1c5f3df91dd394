//! Loading: points a second of each format, of LAZ relative to its decoder alone on the same bytes, and of a filter; and
//! the time to read a header alone.
//!
//! `cargo bench -p surfel-tests --bench loading`; `POINTS` sets the number of points (by default 12 million of PLY
//! and PCD, 5 million of LAZ, filters and headers, and 3 million of the others).

use std::io::Cursor;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use laz::{LazVlr, ParLasZipDecompressor};
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, SaveOptions, inspect, load, load_bytes, save};
use surfel_tests::bench_args::{is_timed, n_points};
use surfel_tests::shared_data::shared_data;

criterion_group!(benches, ply, laz, pcd, ptx, e57, text, grid, off, filter, header);
criterion_main!(benches);

fn ply(criterion: &mut Criterion) {
    let n_points = n_points(12_000_000);
    let cloud = PointCloud { intensity: None, origin: DVec3::ZERO, ..survey(n_points) };
    let path = file(&cloud, "ply");
    drop(cloud);
    let mut group = criterion.benchmark_group("ply");
    group.throughput(Throughput::Elements(n_points as u64)).sample_size(10);
    group.bench_function("xyz float, rgb uchar", |bencher| {
        bencher.iter(|| load(&path, &LoadOptions::default(), &NoProgress).unwrap());
    });
    group.finish();
    std::fs::remove_file(path).unwrap();
}

fn laz(criterion: &mut Criterion) {
    let generated = file(&survey(n_points(5_000_000)), "laz");
    let scan = shared_data().map(|folder| folder.join("clouds/ign_lidar_697k.laz"));
    for path in scan.iter().chain([&generated]) {
        let Ok(bytes) = std::fs::read(path) else {
            report(&format!("skipped: {} is absent", path.display()));
            continue;
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut decoder = Decoder::new(&bytes);
        let read = || load_bytes("a.laz", &bytes, &LoadOptions::default(), &NoProgress).unwrap();

        let mut group = criterion.benchmark_group("laz");
        group.throughput(Throughput::Elements(decoder.n_points)).sample_size(10);
        group.bench_function(BenchmarkId::new("decoder alone", &name), |bencher| {
            bencher.iter(|| decoder.decode(&bytes));
        });
        group.bench_function(BenchmarkId::new("load", &name), |bencher| bencher.iter(read));
        group.finish();

        if is_timed() {
            let ratio = median_ratio(|| decoder.decode(&bytes), read);
            report(&format!("{name}: load has {:.0} % of the decoder's throughput", 100.0 * ratio));
        }
    }
    std::fs::remove_file(generated).unwrap();
}

fn pcd(criterion: &mut Criterion) {
    let cloud = survey(n_points(12_000_000));
    let header = format!(
        "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH {0}\n\
        HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {0}\nDATA binary\n",
        cloud.len()
    );
    let mut bytes = header.into_bytes();
    for (position, [r, g, b]) in cloud.positions.iter().zip(cloud.colors.iter().flatten()) {
        bytes.extend(position.to_array().map(f32::to_le_bytes).concat());
        bytes.extend([*b, *g, *r, 65535].map(|channel| (channel >> 8) as u8));
    }
    time_format(criterion, "pcd", "xyz float, rgb packed", cloud.len(), &bytes);
}

fn ptx(criterion: &mut Criterion) {
    let cloud = survey(n_points(3_000_000));
    let mut text = format!("{}\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n", cloud.len());
    text += "1 0 0 0\n0 1 0 0\n0 0 1 0\n484800 6632800 100 1\n";
    for (position, [r, g, b]) in cloud.positions.iter().zip(cloud.colors.iter().flatten()) {
        let Vec3 { x, y, z } = position;
        let [r, g, b] = [r, g, b].map(|channel| channel >> 8);
        text += &format!("{x:.6} {y:.6} {z:.6} 0.512345 {r} {g} {b}\n");
    }
    time_format(criterion, "ptx", "xyz intensity rgb", cloud.len(), text.as_bytes());
}

fn e57(criterion: &mut Criterion) {
    let cloud = survey(n_points(3_000_000));
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "benchmark").unwrap();
    let axis = |name| Record {
        name,
        data_type: RecordDataType::ScaledInteger {
            min: -(1 << 24),
            max: 1 << 24,
            scale: 1e-3,
            offset: 0.0,
        },
    };
    let mut prototype: Vec<Record> =
        [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ].map(axis).to_vec();
    prototype.extend([Record::COLOR_RED_U8, Record::COLOR_GREEN_U8, Record::COLOR_BLUE_U8]);
    prototype.push(Record::INTENSITY_U16);
    let mut scan = writer.add_pointcloud("scan", prototype).unwrap();
    let intensity = cloud.intensity.iter().flatten();
    let points = cloud.positions.iter().zip(cloud.colors.iter().flatten()).zip(intensity);
    for ((position, color), intensity) in points {
        let position = position.to_array().map(|v| RecordValue::ScaledInteger((v * 1e3) as i64));
        let color = color.map(|channel| RecordValue::Integer(i64::from(channel >> 8)));
        let intensity = RecordValue::Integer(*intensity as i64);
        scan.add_point([&position[..], &color, &[intensity]].concat()).unwrap();
    }
    scan.finalize().unwrap();
    writer.finalize().unwrap();
    drop(writer);
    let bytes = file.into_inner();
    time_format(criterion, "e57", "25-bit xyz, rgb, intensity", cloud.len(), &bytes);
}

fn text(criterion: &mut Criterion) {
    let cloud = survey(n_points(3_000_000));
    let mut text = String::new();
    for (position, [r, g, b]) in cloud.positions.iter().zip(cloud.colors.iter().flatten()) {
        let Vec3 { x, y, z } = position;
        let [r, g, b] = [r, g, b].map(|channel| channel >> 8);
        text += &format!("{x:.3} {y:.3} {z:.3} {r} {g} {b}\n");
    }
    time_format(criterion, "xyz", "xyz rgb", cloud.len(), text.as_bytes());
}

fn grid(criterion: &mut Criterion) {
    let cloud = survey(n_points(3_000_000));
    let n_rows = cloud.len() / 2000;
    let mut text = format!("ncols 2000\nnrows {n_rows}\nxllcorner 0\nyllcorner 0\ncellsize 0.15\n");
    for row in cloud.positions.chunks_exact(2000) {
        text += &row.iter().map(|position| format!("{:.3} ", position.z)).collect::<String>();
        text += "\n";
    }
    time_format(criterion, "asc", "heights", 2000 * n_rows, text.as_bytes());
}

fn off(criterion: &mut Criterion) {
    let cloud = survey(n_points(3_000_000));
    let mut text = format!("OFF\n{} 0 0\n", cloud.len());
    for Vec3 { x, y, z } in &cloud.positions {
        text += &format!("{x:.3} {y:.3} {z:.3}\n");
    }
    time_format(criterion, "off", "vertices", cloud.len(), text.as_bytes());
}

fn filter(criterion: &mut Criterion) {
    let cloud = survey(n_points(5_000_000));
    let filtered =
        LoadOptions { filter: Some("intensity > 20".parse().unwrap()), ..LoadOptions::default() };
    for extension in ["laz", "las", "ply"] {
        let path = file(&cloud, extension);
        let read = |options: &LoadOptions| load(&path, options, &NoProgress).unwrap();
        let mut group = criterion.benchmark_group(format!("filter {extension}"));
        group.throughput(Throughput::Elements(cloud.len() as u64)).sample_size(10);
        group.bench_function("no filter", |bencher| bencher.iter(|| read(&LoadOptions::default())));
        group.bench_function("keeps 99 %", |bencher| bencher.iter(|| read(&filtered)));
        group.finish();
        if is_timed() {
            let ratio = median_ratio(|| read(&filtered), || read(&LoadOptions::default()));
            report(&format!("{extension}: with a filter loading takes {ratio:.3} times as long"));
        }
        std::fs::remove_file(path).unwrap();
    }
}

fn header(criterion: &mut Criterion) {
    let cloud = survey(n_points(5_000_000));
    let mut group = criterion.benchmark_group("header");
    for extension in ["las", "laz", "ply"] {
        let path = file(&cloud, extension);
        group.bench_function(extension, |bencher| bencher.iter(|| inspect(&path).unwrap()));
        std::fs::remove_file(path).unwrap();
    }
    group.finish();
}

/// Times loading of a file with this extension.
fn time_format(criterion: &mut Criterion, extension: &str, columns: &str, n: usize, bytes: &[u8]) {
    let name = format!("a.{extension}");
    let mut group = criterion.benchmark_group(extension);
    group.throughput(Throughput::Elements(n as u64)).sample_size(10);
    group.bench_function(columns, |bencher| {
        bencher.iter(|| load_bytes(&name, bytes, &LoadOptions::default(), &NoProgress).unwrap());
    });
    group.finish();
}

/// The decoder of the crate `laz`, which decodes all points with its own threads to a buffer allocated before.
struct Decoder {
    vlr: LazVlr,
    data_start: u64,
    n_points: u64,
    records: Vec<u8>,
}

impl Decoder {
    fn new(bytes: &[u8]) -> Self {
        let user_id = LazVlr::USER_ID.as_bytes();
        let at = bytes.windows(user_id.len()).position(|window| window == user_id).unwrap();
        let vlr = LazVlr::from_buffer(&bytes[at + 52..]).unwrap();
        let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        let n_points = number(247);
        let records = vec![0; n_points as usize * vlr.items_size() as usize];
        Self { vlr, data_start: number(96) & 0xffff_ffff, n_points, records }
    }

    fn decode(&mut self, bytes: &[u8]) {
        let mut source = Cursor::new(bytes);
        source.set_position(self.data_start);
        let mut decompressor = ParLasZipDecompressor::new(source, self.vlr.clone()).unwrap();
        decompressor.decompress_many(&mut self.records).unwrap();
    }
}

/// Returns the median of the time of `a` over that of `b` in pairs of runs, so that load on the machine cancels.
fn median_ratio<A, B>(mut a: impl FnMut() -> A, mut b: impl FnMut() -> B) -> f64 {
    fn seconds<T>(run: &mut impl FnMut() -> T) -> f64 {
        let start = Instant::now();
        let result = run();
        let seconds = start.elapsed().as_secs_f64();
        // The result is dropped outside of the measured time, because programs that load a cloud keep it.
        drop(result);
        seconds
    }
    let mut ratios: Vec<f64> = (0..15).map(|_| seconds(&mut a) / seconds(&mut b)).collect();
    ratios.sort_by(f64::total_cmp);
    ratios[ratios.len() / 2]
}

/// Returns a hilly site scanned line by line, with noise, colours and intensities.
fn survey(n: usize) -> PointCloud {
    let noise = |i: usize| ((i as u32).wrapping_mul(2_654_435_761) >> 16) as f32 / 65536.0;
    let position = |i: usize| {
        let (x, y) = ((i % 2000) as f32 * 0.15 + 0.1 * noise(i), (i / 2000) as f32 * 0.15);
        let hills = 8.0 * (0.02 * x).sin() * (0.03 * y).cos();
        Vec3::new(x, y + 0.1 * noise(i + 1), hills + 0.05 * noise(i + 2))
    };
    let color = |i: usize| [0, 3, 5].map(|shift| (96.0 + 64.0 * noise(i / 7 + shift)) as u16 * 257);
    PointCloud {
        origin: DVec3::new(484_800.0, 6_632_800.0, 100.0),
        positions: (0..n).map(position).collect(),
        colors: Some((0..n).map(color).collect()),
        intensity: Some((0..n).map(|i| (1.0 + 2000.0 * noise(i / 3)).floor()).collect()),
        ..PointCloud::default()
    }
}

fn file(cloud: &PointCloud, extension: &str) -> PathBuf {
    let name = format!("surfel-loading-{}.{extension}", std::process::id());
    let path = std::env::temp_dir().join(name);
    let options = SaveOptions { resolution: Some(DVec3::splat(0.001)), ..SaveOptions::default() };
    save(&path, cloud, &options, &NoProgress).unwrap();
    path
}

#[expect(clippy::print_stderr, reason = "a benchmark prints its results")]
fn report(line: &str) {
    eprintln!("{line}");
}
