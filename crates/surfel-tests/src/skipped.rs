//! The line by which a test that cannot run is counted.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::thread;

/// Prints the line by which `test.sh` counts a skipped test, once for each test: each runs on a thread of its name.
#[expect(clippy::print_stdout, reason = "the line of a test that cannot run")]
pub fn report_skipped(reason: &str) {
    static REPORTED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let test = thread::current().name().unwrap_or_default().to_owned();
    if REPORTED.lock().is_ok_and(|mut reported| reported.insert(test)) {
        println!("skipped: {reason}");
    }
}
