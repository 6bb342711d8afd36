//! Times of frames: wall, processor, and per stage.

use monro_guidance::simulation::quantile;
use monro_tissue::Stage;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::time::Instant;

/// Milliseconds of each frame.
#[derive(Debug, Default)]
pub(super) struct Samples {
    wall: Vec<f64>,
    cpu: Vec<f64>,
    /// Collision, deformation, surface, check.
    stages: [Vec<f64>; 4],
}

/// The stages' names, in the order of [`Samples::stages`].
const NAMES: [&str; 4] = ["collision", "deformation", "surface", "check"];
/// Place of the surface update among them.
const SURFACE: usize = 2;

/// Processor time of all threads of this process, ms.
fn cpu_ms() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 * 1e3 + t.tv_nsec as f64 * 1e-6
}

impl Samples {
    /// Measures one frame: `step` tells its stages, `surface` comes after it.
    pub(super) fn frame<T>(
        &mut self,
        step: impl FnOnce(&mut dyn FnMut(Stage)) -> T,
        surface: impl FnOnce(),
        counts: bool,
    ) -> T {
        let (cpu, start) = (cpu_ms(), Instant::now());
        let mut spent = [0.0; 4];
        let mut last = start;
        let mut lap = |stage: usize| {
            let now = Instant::now();
            spent[stage] += (now - last).as_secs_f64() * 1e3;
            last = now;
        };
        let out = step(&mut |stage| {
            lap(match stage {
                Stage::Collision => 0,
                Stage::Deformation => 1,
                Stage::Check => 3,
            });
        });
        surface();
        lap(SURFACE);
        if counts {
            self.wall.push(start.elapsed().as_secs_f64() * 1e3);
            self.cpu.push(cpu_ms() - cpu);
            self.stages.iter_mut().zip(spent).for_each(|(all, ms)| all.push(ms));
        }
        out
    }

    /// Median wall time of a frame, ms.
    pub(super) fn median(&self) -> f64 {
        quantile(&self.wall, 0.5)
    }

    /// Medians and the 99th percentile, as members of a JSON object.
    pub(super) fn json(&self) -> Value {
        let least = self.wall.iter().copied().fold(f64::INFINITY, f64::min);
        let stages: serde_json::Map<String, Value> =
            NAMES.iter().zip(&self.stages).map(|(&n, s)| (n.to_owned(), json!(quantile(s, 0.5)))).collect();
        json!({
            "frames": self.wall.len(), "ms_median": self.median(), "ms_p99": quantile(&self.wall, 0.99),
            "ms_min": least, "cpu_ms_median": quantile(&self.cpu, 0.5), "stages_ms_median": stages,
        })
    }
}
