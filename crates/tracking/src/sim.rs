//! `sim:`: the fake tracker's scene without a network between.

use crate::{Batch, Clock, Health, Scene, SceneOptions, Source, TOOLS, TrackingError};
use monro_wire::{Missing, TimedPose};
use std::time::Duration;

const RATE: f64 = 120.0;

/// The scene, as a source.
pub(crate) struct SimSource {
    clock: Clock,
    scene: Scene,
    start: f64,
    frame: u64,
}

impl SimSource {
    pub(crate) fn new(clock: Clock) -> Self {
        Self { clock, scene: Scene::new(SceneOptions::default()), start: clock.now(), frame: 0 }
    }
}

impl Source for SimSource {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        let t = self.frame as f64 / RATE;
        let left = (self.start + t - self.clock.now()).max(0.0);
        std::thread::sleep(Duration::from_secs_f64(left).min(wait));
        if left > wait.as_secs_f64() {
            return Ok(Some(Batch::default()));
        }
        self.frame += 1;
        let now = self.clock.now();
        let one = |(name, pose): (&str, Option<_>)| {
            TimedPose::new(name, None, now, pose.map(|p| (p, None)).ok_or(Missing::NotTracked))
        };
        let poses = TOOLS.into_iter().zip(self.scene.seen(t)).map(one).collect();
        Ok(Some(Batch { poses, ..Batch::default() }))
    }

    fn now(&self) -> f64 {
        self.clock.now()
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::well("simulated")
    }

    fn facts(&self) -> Vec<String> {
        vec![format!("simulated tools: {}", TOOLS.join(", "))]
    }
}
