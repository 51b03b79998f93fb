//! What a measurement ran on.

/// The processor, its cores and the memory, as far as the system tells.
pub(crate) fn describe() -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let field = |text: &str, name: &str| {
        let line = text.lines().find(|line| line.starts_with(name))?;
        line.split_once(':').map(|(_, value)| value.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let processor = field(&read("/proc/cpuinfo"), "model name").unwrap_or_else(|| "unknown processor".to_owned());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let memory = field(&read("/proc/meminfo"), "MemTotal")
        .and_then(|text| text.strip_suffix(" kB")?.parse::<f64>().ok())
        .map_or(String::new(), |kib| format!(", {:.0} GB", kib * 1024.0 / 1e9));
    format!("{processor}, {cores} threads{memory}, {} {}", std::env::consts::OS, std::env::consts::ARCH)
}

/// The commit that this program was built from.
pub(crate) fn commit() -> &'static str {
    env!("YARNRAY_COMMIT")
}
