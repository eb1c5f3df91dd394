//! The processor time of this process, which other programs on the machine change little.

/// Clock ticks a second in `/proc`, on every Linux.
const TICKS_PER_SEC: f64 = 100.0;

/// Returns the processor seconds that all threads have used so far, or NaN where the system does not tell.
pub fn processor_secs() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program, in parentheses, may contain spaces.
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    let user_and_system: Vec<f64> =
        fields.skip(11).take(2).filter_map(|f| f.parse().ok()).collect();
    match user_and_system[..] {
        [user, system] => (user + system) / TICKS_PER_SEC,
        _ => f64::NAN,
    }
}
