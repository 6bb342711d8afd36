//! Rigid bodies as their server defines them. What a tool was calibrated for holds in the frame of its body, and that frame is
//! told by where the markers lie in it: a body that is made anew under its old name has another one.

use crate::{Batch, is_tool};
use monro_geometry::{Point, Tool};
use monro_wire::natnet::{RigidBodyDefinition, Vec3};
use std::collections::BTreeMap;

/// Markers of a body that is the same lie where they lay, by this much, mm.
const SAME_MM: f64 = 0.1;
/// Bodies that are remembered at most.
const MOST: usize = 256;

/// What was said of each body, by its name, when it was first told of or last defined anew.
#[derive(Debug, Clone, Default)]
pub struct Bodies(BTreeMap<String, Frame>);

/// What tells the frame of a body.
#[derive(Debug, Clone)]
struct Frame {
    /// Where its markers lie in it.
    markers: Vec<Point<Tool>>,
    /// What it hangs on, and how; not known of one that was calibrated elsewhere.
    hangs: Option<(i32, Point<Tool>, [f32; 4])>,
}

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
        batch.bodies.iter().filter(is_alone).filter_map(|body| self.compare(&body.name, Frame::of(body))).collect()
    }

    /// Takes that a tool was calibrated with its markers there, mm. How its body differs from that, if it is known to.
    pub fn calibrated(&mut self, tool: &str, markers_mm: &[[f64; 3]]) -> Option<String> {
        let with = Frame { markers: markers_mm.iter().map(|m| Point::from_array(*m)).collect(), hangs: None };
        match self.0.iter().find(|(name, known)| is_tool(name, tool) && known.hangs.is_some()) {
            Some((_, known)) => with.difference(known),
            None => {
                self.0.insert(tool.to_owned(), with);
                None
            }
        }
    }

    /// Where the markers of a tool lie in its frame, mm; `None` where its server does not tell.
    pub fn markers_mm(&self, tool: &str) -> Option<Vec<[f64; 3]>> {
        let (_, body) = self.0.iter().find(|(name, body)| is_tool(name, tool) && !body.markers.is_empty())?;
        Some(body.markers.iter().map(|m| m.to_array()).collect())
    }

    fn compare(&mut self, name: &str, body: Frame) -> Option<Redefined> {
        if self.0.len() >= MOST && !self.0.contains_key(name) {
            return None;
        }
        let before = self.0.entry(name.to_owned()).or_insert_with(|| body.clone());
        let words = before.difference(&body);
        if words.is_some() || before.hangs.is_none() {
            *before = body;
        }
        Some(Redefined { name: name.to_owned(), words: words? })
    }
}

impl Frame {
    fn of(body: &RigidBodyDefinition) -> Self {
        let at = |metres: Vec3| Point::from_array(metres.map(|v| 1e3 * f64::from(v)));
        let markers = body.markers.iter().map(|m| at(m.offset)).collect();
        Self { markers, hangs: Some((body.parent, at(body.offset), body.rotation_xyzw)) }
    }

    /// How another differs from this one, if it does.
    fn difference(&self, after: &Self) -> Option<String> {
        let [n, m] = [self, after].map(|b| b.markers.len());
        // None are told by servers before 3.0.
        if n != m && n.min(m) > 0 {
            return Some(format!("it had {n} markers and has {m}"));
        }
        let moved = self.markers.iter().zip(&after.markers).map(|(b, a)| distance(*b, *a));
        let far = moved.reduce(f64::max).unwrap_or(0.0);
        if far > SAME_MM {
            return Some(format!("its markers lie up to {far:.1} mm from where they lay in it"));
        }
        let ((parent, offset, rotation), (to, there, turned)) = self.hangs.zip(after.hangs)?;
        let [rotation, turned] = [rotation, turned].map(|q| q.map(f32::to_bits));
        (parent != to || rotation != turned || distance(offset, there) > SAME_MM)
            .then(|| "its offset to what it hangs on is another".to_owned())
    }
}

/// Between two places, mm. What is no place is far from all that are.
fn distance(a: Point<Tool>, b: Point<Tool>) -> f64 {
    match [a, b].map(|p| p.is_finite()) {
        [true, true] => a.distance(b),
        [false, false] => 0.0,
        _ => f64::INFINITY,
    }
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

    /// A calibration that was made in another session was never compared.
    #[test]
    fn what_a_tool_was_calibrated_with_is_compared_whenever_its_server_tells_of_it() {
        let mm =
            |shift: f64| MARKERS.map(|m| [1e3 * f64::from(m[0]) + shift, 1e3 * f64::from(m[1]), 1e3 * f64::from(m[2])]);
        for (shift, same) in [(0.0, true), (0.05, true), (2.0, false)] {
            let mut talk = Talk::new(Version::new(4, 1));
            talk.server.redefine("Catheter", &MARKERS);
            assert_eq!(talk.bodies.calibrated("Catheter", &mm(9.0)), None, "nothing is known yet");
            assert_eq!(talk.bodies.calibrated("Catheter", &mm(shift)), None, "the last one counts");
            let found = talk.go_on(3.0);
            assert_eq!(found.is_empty(), same, "{found:?}");
            // What the server says is what counts from then on.
            assert_eq!(talk.go_on(3.0), []);
            assert_eq!(talk.bodies.calibrated("Catheter", &mm(0.0)), None);
            assert_eq!(talk.bodies.calibrated("Reference", &[]), None);
            let words = talk.bodies.calibrated("Catheter", &mm(5.0)).expect("another");
            assert!(words.contains("5.0 mm"), "{words}");
            let told = talk.bodies.markers_mm("Catheter").expect("markers");
            assert!((told[0][0] - 30.0).abs() < 1e-4 && told.len() == 3, "{told:?}");
        }
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
        assert_eq!(bodies.take(&said(vec![body(f32::NAN)])), [], "it is told once");
    }
}
