//! FRAMEOFDATA: to bytes, in any version (for the fake Motive and the tests).

use super::frame::{Asset, ChannelData, Frame, LabeledMarker, MarkerSet, RigidBody, Skeleton, Suffix};
use super::message::datagram;
use super::{MessageId, Version, W};

impl Frame {
    /// The datagram, in the layout of a version. What a version does not have is left out.
    pub fn encode(&self, version: Version) -> Vec<u8> {
        let v = version;
        let mut w = W::new();
        w.i32(self.number);
        section(&mut w, v, true, &self.marker_sets, marker_set);
        section(&mut w, v, true, &self.other_markers, |w, m, _| w.floats(m));
        section(&mut w, v, true, &self.rigid_bodies, rigid_body);
        section(&mut w, v, v.since(2, 1), &self.skeletons, skeleton);
        section(&mut w, v, v.since(4, 1), &self.assets, asset);
        section(&mut w, v, v.since(2, 3), &self.labeled_markers, labeled_marker);
        section(&mut w, v, v.since(2, 9), &self.force_plates, channel_data);
        section(&mut w, v, v.since(2, 11), &self.devices, channel_data);
        suffix(&mut w, &self.suffix, v);
        datagram(MessageId::Frame, &w.0)
    }
}

fn section<T>(w: &mut W, v: Version, present: bool, items: &[T], item: impl Fn(&mut W, &T, Version)) {
    if !present {
        return;
    }
    w.count(items.len());
    let mut inner = W::new();
    items.iter().for_each(|i| item(&mut inner, i, v));
    if v.since(4, 1) {
        w.count(inner.0.len());
    }
    w.bytes(&inner.0);
}

fn marker_set(w: &mut W, set: &MarkerSet, _: Version) {
    w.c_text(&set.name);
    w.count(set.markers.len());
    set.markers.iter().for_each(|m| w.floats(m));
}

fn rigid_body(w: &mut W, body: &RigidBody, v: Version) {
    w.i32(body.id);
    w.floats(&body.position);
    w.floats(&body.quaternion_xyzw);
    if !v.since(3, 0) {
        w.count(body.markers.len());
        body.markers.iter().for_each(|m| w.floats(&m.position));
        body.markers.iter().for_each(|m| w.i32(m.id));
        body.markers.iter().for_each(|m| w.f32(m.size));
    }
    w.f32(body.error);
    if v.since(2, 6) {
        w.u16(body.params.unwrap_or(1));
    }
}

fn bodies(w: &mut W, list: &[RigidBody], v: Version) {
    w.count(list.len());
    list.iter().for_each(|b| rigid_body(w, b, v));
}

fn skeleton(w: &mut W, s: &Skeleton, v: Version) {
    w.i32(s.id);
    bodies(w, &s.bones, v);
}

fn asset(w: &mut W, a: &Asset, v: Version) {
    w.i32(a.id);
    bodies(w, &a.bodies, v);
    w.count(a.markers.len());
    a.markers.iter().for_each(|m| labeled_marker(w, m, v));
}

fn labeled_marker(w: &mut W, m: &LabeledMarker, v: Version) {
    w.i32(m.id);
    w.floats(&m.position);
    w.f32(m.size);
    if v.since(2, 6) {
        w.u16(m.params);
    }
    if v.since(3, 0) {
        w.f32(m.residual);
    }
}

fn channel_data(w: &mut W, d: &ChannelData, _: Version) {
    w.i32(d.id);
    w.count(d.channels.len());
    for c in &d.channels {
        w.count(c.len());
        w.floats(c);
    }
}

fn suffix(w: &mut W, s: &Suffix, v: Version) {
    if !v.since(3, 0) {
        w.f32(s.latency);
    }
    w.u32(s.timecode);
    w.u32(s.timecode_sub);
    if v.since(2, 7) {
        w.f64(s.timestamp);
    } else {
        w.f32(s.timestamp as f32);
    }
    if v.since(3, 0) {
        w.u64(s.mid_exposure);
        w.u64(s.received);
        w.u64(s.transmitted);
    }
    if v.since(4, 1) {
        w.u32(s.precision_seconds);
        w.u32(s.precision_fraction);
    }
    w.u16(s.params);
    w.i32(0);
}
