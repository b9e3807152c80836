//! Where a measurement comes from: version, processor, memory and clocks, and never the name of a machine.

/// Version of vargeo.
pub fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// The commit that vargeo was built from, or `unknown`.
pub fn commit() -> &'static str {
    env!("VARGEO_COMMIT")
}

/// Processor family and the widest vector instructions that it offers, such as `x86_64 avx512`.
pub fn target() -> String {
    let family = std::env::consts::ARCH;
    format!("{family} {}", features())
}

#[cfg(target_arch = "x86_64")]
fn features() -> &'static str {
    use std::arch::is_x86_feature_detected;
    if is_x86_feature_detected!("avx512f") {
        "avx512"
    } else if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        "avx2"
    } else {
        "baseline"
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn features() -> &'static str {
    "baseline"
}

/// The processor's own name, its number of usable cores, and the operating system.
pub fn host() -> String {
    let information = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':'))
        .map_or("unknown processor", |(_, name)| name.trim());
    format!("{model}, {} cores, {}", cores(), std::env::consts::OS)
}

/// Cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Seconds since 1970 in UTC.
pub fn now() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |duration| duration.as_secs() as i64)
}

/// Processor seconds that this process has used on all its threads.
pub fn cpu_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Peak resident memory of this process in bytes; 0 where the system does not tell.
///
/// Read inside the process: what its parent learns when it ends includes the parent's own memory before the start.
pub fn peak_memory() -> u64 {
    status_bytes("/proc/self/status", "VmHWM:").unwrap_or(0)
}

/// Resident memory of another process in bytes.
pub fn resident_memory(process: u32) -> Option<u64> {
    status_bytes(&format!("/proc/{process}/status"), "VmRSS:")
}

fn status_bytes(path: &str, field: &str) -> Option<u64> {
    let status = std::fs::read_to_string(path).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(field))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kibibytes)
}
