//! Load test of a viewer: pages that all orbit the scene at once, their frame rates and latencies, and the memory
//! of the server.
//!
//! `cargo run --release -p surfel-web --example load -- LINK PAGES SECONDS [PID of the server]`
#![allow(clippy::print_stdout, reason = "this program prints its measurements")]

mod clients;

use clients::{Failure, PageStats, orbit_pages};
use std::time::{Duration, Instant};

/// Interval between two samples of the server's memory.
const MEMORY_INTERVAL: Duration = Duration::from_secs(5);
/// Fraction of the samples in the first part of the run, during which buffers get their size.
const WARM_UP: f64 = 0.25;

#[tokio::main]
async fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [link, n_pages, secs, pid @ ..] = &args[..] else {
        return Err("expected LINK PAGES SECONDS [PID]".into());
    };
    let (n_pages, secs): (usize, f64) = (n_pages.parse()?, secs.parse()?);
    let duration = Duration::from_secs_f64(secs);
    let pages = orbit_pages(link, n_pages, duration);
    let Some(pid) = pid.first() else {
        report(&pages.await?, secs);
        return Ok(());
    };
    // One page is opened and closed before, as memory of the scene is taken when a picture is first drawn.
    orbit_pages(link, 1, Duration::from_secs(1)).await?;
    let without_pages = resident_mib(pid)?;
    let (pages, memory) = tokio::join!(pages, sample_memory(pid, duration));
    report(&pages?, secs);
    report_memory(without_pages, &memory?, n_pages);
    Ok(())
}

/// Resident memory of a process in MiB.
fn resident_mib(pid: &str) -> Result<f64, Failure> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.strip_suffix("kB"));
    Ok(kib.unwrap_or_default().trim().parse::<f64>()? / 1024.0)
}

/// Prints the server's memory over time, and returns the samples in MiB.
async fn sample_memory(pid: &str, duration: Duration) -> Result<Vec<f64>, Failure> {
    let (start, mut samples) = (Instant::now(), Vec::new());
    while start.elapsed() + MEMORY_INTERVAL < duration {
        tokio::time::sleep(MEMORY_INTERVAL).await;
        let mib = resident_mib(pid)?;
        println!("{:5.0} s {mib:8.1} MiB", start.elapsed().as_secs_f64());
        samples.push(mib);
    }
    Ok(samples)
}

fn report(pages: &[PageStats], secs: f64) {
    let rates: Vec<f64> = pages.iter().map(|page| f64::from(page.n_pictures) / secs).collect();
    let min = rates.iter().copied().fold(f64::INFINITY, f64::min);
    let max = rates.iter().copied().fold(0.0, f64::max);
    let texts: Vec<String> = rates.iter().map(|rate| format!("{rate:.1}")).collect();
    println!("pictures a second: {}", texts.join(" "));
    println!("minimum {min:.1}, maximum {max:.1}, ratio {:.2}", max / min);
    let mut latencies: Vec<Duration> =
        pages.iter().flat_map(|page| &page.latencies).copied().collect();
    latencies.sort();
    let quantile = |q: f64| latencies.get((q * latencies.len() as f64) as usize);
    if let (Some(median), Some(p95)) = (quantile(0.5), quantile(0.95)) {
        println!("latency: median {median:.0?}, 95% within {p95:.0?}");
    }
}

fn report_memory(without_pages: f64, samples: &[f64], n_pages: usize) {
    let warm = &samples[(WARM_UP * samples.len() as f64) as usize..];
    if let (Some(first), Some(last)) = (warm.first(), warm.last()) {
        let a_page = (last - without_pages) / n_pages as f64;
        println!("memory: {without_pages:.1} MiB without pages, {a_page:.1} MiB a page");
        println!("memory after a quarter of the time {first:.1} MiB, at the end {last:.1} MiB");
    }
}
