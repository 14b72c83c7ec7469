//! The machine that runs the command, for records of benchmarks.

use std::time::SystemTime;

use serde_json::{Value, json};

/// Processor, its number, operating system and architecture, as a JSON object.
pub fn machine() -> Value {
    json!({
        "processor": processor(),
        "processors": std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        "system": std::env::consts::OS,
        "architecture": std::env::consts::ARCH,
    })
}

/// The time now in UTC, as of RFC 3339.
pub fn now() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string()
}

/// Name of the processor, where the system tells it: on Linux its model or, of ARM, its part.
fn processor() -> Option<String> {
    let told = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let value = |key: &str| {
        let line = told.lines().find(|line| line.starts_with(key))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    value("model name").or_else(|| value("CPU part").map(|part| format!("ARM part {part}"))).or_else(|| {
        let printed = std::process::Command::new("sysctl").args(["-n", "machdep.cpu.brand_string"]).output();
        let name = String::from_utf8(printed.ok()?.stdout).ok()?.trim().to_owned();
        (!name.is_empty()).then_some(name)
    })
}
