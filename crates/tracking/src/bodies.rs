//! Rigid bodies as their server defines them. What a tool was calibrated for holds in the frame of its body, and that frame is
//! told by where the markers lie in it: a body that is made anew under its old name has another one.

use crate::Batch;
use monro_wire::natnet::{RigidBodyDefinition, Vec3};
use std::collections::BTreeMap;

/// Markers of a body that is the same lie where they lay, by this much, mm.
const SAME_MM: f64 = 0.1;
/// Bodies that are remembered at most.
const MOST: usize = 256;

/// What was said of each body, by its name, when it was first told of or last defined anew.
#[derive(Debug, Clone, Default)]
pub struct Bodies(BTreeMap<String, RigidBodyDefinition>);

/// A body that was defined anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Redefined {
    /// Its name.
    pub name: String,
    /// What is different, for people.
    pub words: String,
}

impl Bodies {
    /// Takes what was said of bodies; those whose frame is not what it was.
    pub fn take(&mut self, batch: &Batch) -> Vec<Redefined> {
        let is_alone = |b: &&RigidBodyDefinition| batch.bodies.iter().filter(|o| o.name == b.name).count() == 1;
        batch.bodies.iter().filter(is_alone).filter_map(|body| self.compare(body)).collect()
    }

    fn compare(&mut self, body: &RigidBodyDefinition) -> Option<Redefined> {
        if self.0.len() >= MOST && !self.0.contains_key(&body.name) {
            return None;
        }
        let before = self.0.entry(body.name.clone()).or_insert_with(|| body.clone());
        let words = difference(before, body)?;
        before.clone_from(body);
        Some(Redefined { name: body.name.clone(), words })
    }
}

/// How the frame of a body differs from what it was, if it does.
fn difference(before: &RigidBodyDefinition, after: &RigidBodyDefinition) -> Option<String> {
    let [n, m] = [before, after].map(|b| b.markers.len());
    if n != m {
        return Some(format!("it had {n} markers and has {m}"));
    }
    let moved = before.markers.iter().zip(&after.markers).map(|(b, a)| distance_mm(b.offset, a.offset));
    let far = moved.reduce(f64::max).unwrap_or(0.0);
    if far > SAME_MM {
        return Some(format!("its markers lie up to {far:.1} mm from where they lay in it"));
    }
    let is_turned = before.rotation_xyzw != after.rotation_xyzw || before.parent != after.parent;
    (is_turned || distance_mm(before.offset, after.offset) > SAME_MM)
        .then(|| "its offset to what it hangs on is another".to_owned())
}

/// Between two places in m. What is no number is far.
fn distance_mm(a: Vec3, b: Vec3) -> f64 {
    let square = |i: usize| (f64::from(a[i]) - f64::from(b[i])).powi(2);
    let d = 1e3 * (0..3).map(square).sum::<f64>().sqrt();
    if d.is_nan() { f64::INFINITY } else { d }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stamps;
    use crate::decode::{NatNetDecoder, Taken};
    use monro_wire::natnet::{ClientOptions, Server, ServerOptions, UpAxis, Version};

    const MARKERS: [Vec3; 3] = [[0.03, 0.0, 0.0], [-0.03, 0.0, 0.01], [0.0, 0.04, 0.0]];

    /// A fake Motive and a client, a frame every 10 ms.
    struct Talk {
        server: Server,
        decoder: NatNetDecoder,
        bodies: Bodies,
        frame: u32,
    }

    impl Talk {
        fn new(version: Version) -> Self {
            let names = ["Catheter", "Reference"].map(str::to_owned).to_vec();
            let (frequency, data_port, multicast) = (1_000_000, 1511, false);
            let options =
                ServerOptions { version, bodies: names, frequency, data_port, multicast, up: UpAxis::Y, rate: 100.0 };
            let decoder = NatNetDecoder::new(ClientOptions::default(), Stamps::default());
            Self { server: Server::new(options), decoder, bodies: Bodies::default(), frame: 0 }
        }

        /// What is found within some seconds.
        fn go_on(&mut self, seconds: f64) -> Vec<Redefined> {
            let mut found = Vec::new();
            for _ in 0..(seconds * 100.0) as u32 {
                let now = f64::from(self.frame) / 100.0;
                self.frame += 1;
                let asked = self.decoder.client.poll(now);
                let answers = asked.iter().filter_map(|q| self.server.receive(q, now).expect("read"));
                let mut said: Vec<_> = answers.collect();
                said.push(self.server.frame(&[(None, 0.3), (None, 0.3)], now, now));
                for bytes in said {
                    if let Taken::Frame(batch) = self.decoder.take(now, &bytes) {
                        found.extend(self.bodies.take(&batch));
                    }
                }
            }
            found
        }
    }

    /// Its tip was then shown where the old frame had it, without a word.
    #[test]
    fn a_body_defined_anew_under_its_old_name_kept_its_calibration() {
        for version in ["3.0", "4.0", "4.1", "4.3"].map(|v| Version::parse(v).expect("version")) {
            let mut talk = Talk::new(version);
            talk.server.redefine("Catheter", &MARKERS);
            assert_eq!(talk.go_on(5.0), []);
            talk.server.redefine("Catheter", &MARKERS.map(|m| [m[0] + 0.012, m[1], m[2]]));
            let found = talk.go_on(3.0);
            assert_eq!(found.len(), 1, "{version}: {found:?}");
            assert!(found[0].name == "Catheter" && found[0].words.contains("12.0 mm"), "{found:?}");
            assert_eq!(talk.go_on(5.0), [], "it is told once");
            talk.server.redefine("Reference", &MARKERS);
            let found = talk.go_on(3.0);
            assert!(found.len() == 1 && found[0].words.contains("4 markers and has 3"), "{found:?}");
        }
    }

    #[test]
    fn a_server_that_does_not_tell_markers_or_tells_them_anew_has_defined_nothing() {
        let mut talk = Talk::new(Version::new(2, 9));
        assert_eq!(talk.go_on(5.0), []);
        talk.server.redefine("Catheter", &MARKERS);
        assert_eq!(talk.go_on(5.0), []);
        let mut talk = Talk::new(Version::new(4, 1));
        assert_eq!(talk.go_on(1.0), []);
        // Its bodies are made anew with the markers where they were, and numbered in another order.
        talk.server.rename(["Reference", "Catheter"].map(str::to_owned).to_vec());
        assert_eq!(talk.go_on(5.0), []);
    }

    #[test]
    fn a_marker_at_no_place_and_two_bodies_of_one_name_are_survived() {
        let body = |x: f32| RigidBodyDefinition {
            name: "Catheter".to_owned(),
            offset: [x, 0.0, 0.0],
            ..RigidBodyDefinition::default()
        };
        let said = |bodies: Vec<RigidBodyDefinition>| Batch { bodies, ..Batch::default() };
        let mut bodies = Bodies::default();
        assert_eq!(bodies.take(&said(vec![body(0.0)])), []);
        assert_eq!(bodies.take(&said(vec![body(0.0), body(1.0)])), []);
        assert_eq!(bodies.take(&said(vec![body(5e-5)])), []);
        assert_eq!(bodies.take(&said(vec![body(f32::NAN)])).len(), 1);
    }
}
