//! FRAMEOFDATA: from bytes.

use super::frame::{
    Asset, BodyMarker, ChannelData, Fault, Frame, LabeledMarker, MarkerSet, RigidBody, Skeleton, Suffix,
};
use super::{NatNetError, R, Version};
use crate::ReadError;

impl Frame {
    /// Reads the payload of FRAMEOFDATA.
    ///
    /// # Errors
    /// When a count or a size contradicts the bytes present, or the frame does not end as its version should.
    pub fn decode(payload: &[u8], version: Version) -> Result<Self, NatNetError> {
        if version < Version::OLDEST {
            return Err(NatNetError::TooOld(version));
        }
        let mut decoder = Decoder { r: R::new(payload), v: version, faults: Vec::new() };
        let mut frame = decoder.frame()?;
        frame.faults = decoder.faults;
        Ok(frame)
    }
}

struct Decoder<'a> {
    r: R<'a>,
    v: Version,
    faults: Vec<Fault>,
}

impl<'a> Decoder<'a> {
    fn frame(&mut self) -> Result<Frame, NatNetError> {
        let v = self.v;
        let number = self.named(|r| r.i32("frame number"))?;
        let mut frame = Frame { number, ..Frame::default() };
        frame.marker_sets = self.section("marker sets", true, 5, marker_set)?;
        frame.other_markers = self.section("other markers", true, 12, |r, _| r.floats("marker"))?;
        frame.rigid_bodies = self.section("rigid bodies", true, 32, rigid_body)?;
        frame.skeletons = self.section("skeletons", v.since(2, 1), 8, skeleton)?;
        frame.assets = self.section("assets", v.since(4, 1), 12, asset)?;
        frame.labeled_markers = self.section("labeled markers", v.since(2, 3), 20, labeled_marker)?;
        frame.force_plates = self.section("force plates", v.since(2, 9), 8, channel_data)?;
        frame.devices = self.section("devices", v.since(2, 11), 8, channel_data)?;
        frame.suffix = self.suffix()?;
        Ok(frame)
    }

    fn named<T>(&mut self, read: impl FnOnce(&mut R<'a>) -> Result<T, ReadError>) -> Result<T, NatNetError> {
        read(&mut self.r).map_err(|source| NatNetError::Read { message: "frame", version: self.v, source })
    }

    /// A counted section. Since 4.1 its size in bytes stands after the count and is the authority for where it ends.
    fn section<T>(
        &mut self,
        name: &'static str,
        present: bool,
        smallest: usize,
        item: impl Fn(&mut R<'_>, Version) -> Result<T, ReadError>,
    ) -> Result<Vec<T>, NatNetError> {
        if !present {
            return Ok(Vec::new());
        }
        let v = self.v;
        if !v.since(4, 1) {
            return self.named(|r| {
                let n = r.count(smallest, name)?;
                r.many(n, |r| item(r, v))
            });
        }
        let (count, bytes) = self.sized(name)?;
        let mut inner = R::new(bytes);
        let fits = usize::try_from(count).ok().filter(|n| n.saturating_mul(smallest) <= bytes.len());
        let items = fits
            .ok_or(ReadError::Count { what: name, count: count.into(), left: bytes.len() })
            .and_then(|n| inner.many(n, |r| item(r, v)))
            .map_err(|source| NatNetError::Read { message: "frame", version: v, source })?;
        if inner.left() > 0 {
            self.faults.push(Fault::SectionEnd { section: name, unread: inner.left() });
        }
        Ok(items)
    }

    /// Count and bytes of a section that tells its size.
    fn sized(&mut self, section: &'static str) -> Result<(i32, &'a [u8]), NatNetError> {
        let (count, size) = self.named(|r| Ok((r.i32(section)?, r.i32(section)?)))?;
        let left = self.r.left();
        let Some(n) = usize::try_from(size).ok().filter(|&n| n <= left) else {
            return Err(NatNetError::Section { section, size, left });
        };
        Ok((count, self.named(|r| r.take(n, section))?))
    }

    fn suffix(&mut self) -> Result<Suffix, NatNetError> {
        let v = self.v;
        let mut s = self.named(|r| times(r, v))?;
        // Newer versions may add fields here; the last six bytes are params and end marker in all of them.
        let extra = self.r.left().saturating_sub(6);
        if extra > 0 {
            self.faults.push(Fault::Extra(extra));
            self.named(|r| r.take(extra, "unknown fields"))?;
        }
        s.params = self.named(|r| r.u16("frame params"))?;
        let found = self.named(|r| r.i32("end marker"))?;
        if found != 0 || (extra > 0 && !v.is_newer_than_tested()) {
            return Err(NatNetError::End { version: v, found });
        }
        Ok(s)
    }
}

fn times(r: &mut R<'_>, v: Version) -> Result<Suffix, ReadError> {
    let mut s = Suffix::default();
    if !v.since(3, 0) {
        s.latency = r.f32("latency")?;
    }
    s.timecode = r.u32("timecode")?;
    s.timecode_sub = r.u32("timecode")?;
    s.timestamp = if v.since(2, 7) { r.f64("timestamp")? } else { r.f32("timestamp")?.into() };
    if v.since(3, 0) {
        s.mid_exposure = r.u64("mid-exposure")?;
        s.received = r.u64("camera data received")?;
        s.transmitted = r.u64("transmission")?;
    }
    if v.since(4, 1) {
        s.precision_seconds = r.u32("precision timestamp")?;
        s.precision_fraction = r.u32("precision timestamp")?;
    }
    Ok(s)
}

fn marker_set(r: &mut R<'_>, _: Version) -> Result<MarkerSet, ReadError> {
    let name = r.c_text("marker set name")?;
    let n = r.count(12, "markers of a set")?;
    Ok(MarkerSet { name, markers: r.many(n, |r| r.floats("marker"))? })
}

fn rigid_body(r: &mut R<'_>, v: Version) -> Result<RigidBody, ReadError> {
    Ok(RigidBody {
        id: r.i32("rigid body id")?,
        position: r.floats("rigid body position")?,
        quaternion_xyzw: r.floats("rigid body orientation")?,
        markers: if v.since(3, 0) { Vec::new() } else { body_markers(r)? },
        error: r.f32("mean marker error")?,
        params: if v.since(2, 6) { Some(r.u16("rigid body params")?) } else { None },
    })
}

/// All positions, then all ids, then all sizes.
fn body_markers(r: &mut R<'_>) -> Result<Vec<BodyMarker>, ReadError> {
    let n = r.count(20, "markers of a rigid body")?;
    let mut markers =
        r.many(n, |r| Ok::<_, ReadError>(BodyMarker { position: r.floats("marker")?, ..BodyMarker::default() }))?;
    for m in &mut markers {
        m.id = r.i32("marker id")?;
    }
    for m in &mut markers {
        m.size = r.f32("marker size")?;
    }
    Ok(markers)
}

fn bodies(r: &mut R<'_>, v: Version) -> Result<Vec<RigidBody>, ReadError> {
    let n = r.count(32, "bodies")?;
    r.many(n, |r| rigid_body(r, v))
}

fn skeleton(r: &mut R<'_>, v: Version) -> Result<Skeleton, ReadError> {
    Ok(Skeleton { id: r.i32("skeleton id")?, bones: bodies(r, v)? })
}

fn asset(r: &mut R<'_>, v: Version) -> Result<Asset, ReadError> {
    let (id, bodies) = (r.i32("asset id")?, bodies(r, v)?);
    let n = r.count(26, "asset markers")?;
    Ok(Asset { id, bodies, markers: r.many(n, |r| labeled_marker(r, v))? })
}

fn labeled_marker(r: &mut R<'_>, v: Version) -> Result<LabeledMarker, ReadError> {
    Ok(LabeledMarker {
        id: r.i32("labeled marker id")?,
        position: r.floats("labeled marker")?,
        size: r.f32("labeled marker size")?,
        params: if v.since(2, 6) { r.u16("labeled marker params")? } else { 0 },
        residual: if v.since(3, 0) { r.f32("labeled marker residual")? } else { 0.0 },
    })
}

fn channel_data(r: &mut R<'_>, _: Version) -> Result<ChannelData, ReadError> {
    let id = r.i32("device id")?;
    let n = r.count(4, "channels")?;
    let channels = r.many(n, |r| {
        let n = r.count(4, "channel samples")?;
        r.many(n, |r| r.f32("sample"))
    })?;
    Ok(ChannelData { id, channels })
}
