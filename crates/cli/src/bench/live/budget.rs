//! Who uses the processors: time on a core by thread, from `/proc` (Linux; elsewhere there is nothing to tell).

use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::time::Instant;

/// Names of the threads of each part, as they begin.
const PARTS: [(&str, &[&str]); 7] = [
    ("soft_body", &["deformation", "tissue-"]),
    ("tracker", &["tracker", "natnet"]),
    ("server", &["server", "tokio-rt-worker"]),
    ("bench_camera", &["bench-camera"]),
    ("bench_displays", &["bench-display"]),
    ("bench_igtl_peer", &["bench-peer"]),
    ("recording", &["recording"]),
];

/// Time on a core so far, of every thread of this process.
#[derive(Debug)]
pub(crate) struct Sample {
    at: Instant,
    /// By thread id: its name and its time, ns.
    threads: BTreeMap<String, (String, u64)>,
}

impl Sample {
    pub(crate) fn take() -> Self {
        let tasks = fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
        let one = |task: fs::DirEntry| {
            let read = |file: &str| fs::read_to_string(task.path().join(file)).ok();
            // The first number of schedstat is the time spent on a core, ns.
            let time = read("schedstat")?.split_whitespace().next()?.parse().ok()?;
            Some((task.file_name().to_string_lossy().into_owned(), (read("comm")?.trim().to_owned(), time)))
        };
        Self { at: Instant::now(), threads: tasks.filter_map(one).collect() }
    }

    /// Milliseconds of a core that each part has used per second since `earlier`.
    pub(crate) fn since(&self, earlier: &Self) -> Value {
        let seconds = self.at.duration_since(earlier.at).as_secs_f64().max(1e-3);
        let mut used = Map::new();
        for (id, (name, time)) in &self.threads {
            let part = PARTS.iter().find(|(_, names)| names.iter().any(|n| name.starts_with(n)));
            let before = earlier.threads.get(id).map_or(0, |(_, t)| *t);
            let ms_per_s = time.saturating_sub(before) as f64 / 1e6 / seconds;
            let sum = used.entry(part.map_or("other", |(part, _)| part)).or_insert(json!(0.0));
            *sum = json!(sum.as_f64().unwrap_or(0.0) + ms_per_s);
        }
        used.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;
    use std::thread;

    #[test]
    fn a_thread_that_works_is_counted_to_its_part() {
        let (begin, told) = channel();
        let (end, ended) = channel::<()>();
        let worker = thread::Builder::new().name("deformation".into()).spawn(move || {
            let start = Instant::now();
            while start.elapsed().as_secs_f64() < 0.2 {
                std::hint::spin_loop();
            }
            let _ = begin.send(());
            let _ = ended.recv();
        });
        let before = Sample::take();
        told.recv().expect("worked");
        let used = Sample::take().since(&before);
        drop(end);
        worker.expect("thread").join().expect("joined");
        let (soft_body, displays) = (used["soft_body"].as_f64(), used.get("bench_displays"));
        assert!(soft_body.is_some_and(|ms| ms > 1.0) && displays.is_none(), "{used}");
    }
}
