//! Binary glTF 2.0 surfaces (`.glb`), written only.
//!
//! The vertices stay LPS mm; the root node turns and scales them to glTF's metres with y up and the face towards +z
//! (glTF 2.0, 3.4 "Coordinate System and Units"), so that a viewer shows the head upright.

use monro_geometry::TriangleMesh;
use serde_json::{Value, json};

const JSON_CHUNK: u32 = 0x4E4F_534A;
const BINARY_CHUNK: u32 = 0x004E_4942;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY: u32 = 34962;
const INDICES: u32 = 34963;
/// A quarter turn about x: (x, y, z) becomes (x, z, -y).
const TURN: [f64; 4] = [-core::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, core::f64::consts::FRAC_1_SQRT_2];

/// Encodes surfaces as nodes of the given names with smooth normals and a colour each (linear RGB). Empty ones are left
/// out, since glTF has no empty arrays.
pub fn encode(objects: &[(&str, [f32; 3], &TriangleMesh)]) -> Vec<u8> {
    let mut file = Parts::default();
    for (name, colour, mesh) in objects.iter().filter(|o| !o.2.triangles.is_empty()) {
        file.add(name, *colour, mesh);
    }
    file.container()
}

/// The arrays of the JSON part, and the binary part.
#[derive(Default)]
struct Parts {
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    binary: Vec<u8>,
}

impl Parts {
    fn add(&mut self, name: &str, colour: [f32; 3], mesh: &TriangleMesh) {
        let number = self.meshes.len();
        let position = self.vectors(mesh.vertices.iter().map(|p| p.to_array()), true);
        let normal = self.vectors(mesh.vertex_normals().into_iter().map(|n| n.to_array()), false);
        let bytes = mesh.triangles.as_flattened().iter().flat_map(|v| v.to_le_bytes());
        let view = self.view(bytes, INDICES);
        let count = mesh.triangles.len() * 3;
        self.accessors
            .push(json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR" }));
        let indices = self.accessors.len() - 1;
        let [r, g, b] = colour;
        self.materials.push(json!({
            "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8 }
        }));
        self.meshes.push(json!({ "name": name, "primitives": [
            { "attributes": { "POSITION": position, "NORMAL": normal }, "indices": indices, "material": number }
        ] }));
        self.nodes.push(json!({ "name": name, "mesh": number }));
    }

    /// An accessor of vectors; positions must tell their bounds.
    fn vectors(&mut self, all: impl Iterator<Item = [f64; 3]>, bounds: bool) -> usize {
        let all: Vec<[f32; 3]> = all.map(|v| v.map(|c| c as f32)).collect();
        let view = self.view(all.as_flattened().iter().flat_map(|c| c.to_le_bytes()), ARRAY);
        let mut accessor = json!({ "bufferView": view, "componentType": FLOAT, "count": all.len(), "type": "VEC3" });
        if bounds {
            let each = |pick: fn(f32, f32) -> f32, start: f32| {
                all.iter().fold([start; 3], |m, v| core::array::from_fn(|a| pick(m[a], v[a])))
            };
            accessor["min"] = json!(each(f32::min, f32::INFINITY));
            accessor["max"] = json!(each(f32::max, f32::NEG_INFINITY));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn view(&mut self, bytes: impl Iterator<Item = u8>, target: u32) -> usize {
        let start = self.binary.len();
        self.binary.extend(bytes);
        let length = self.binary.len() - start;
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length, "target": target }));
        self.views.len() - 1
    }

    fn container(mut self) -> Vec<u8> {
        let children: Vec<usize> = (0..self.nodes.len()).collect();
        let root = self.nodes.len();
        let mut node = json!({ "name": "LPS mm", "rotation": TURN, "scale": [1e-3, 1e-3, 1e-3] });
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        self.nodes.push(node);
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "monro" }, "scene": 0, "scenes": [{ "nodes": [root] }], "nodes": self.nodes,
        });
        let lists = [("meshes", self.meshes), ("materials", self.materials), ("accessors", self.accessors)];
        for (name, list) in lists.into_iter().chain([("bufferViews", self.views)]).filter(|l| !l.1.is_empty()) {
            root[name] = Value::Array(list);
        }
        if !self.binary.is_empty() {
            root["buffers"] = json!([{ "byteLength": self.binary.len() }]);
        }
        let mut text = root.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let mut chunks = vec![(JSON_CHUNK, text)];
        if !self.binary.is_empty() {
            chunks.push((BINARY_CHUNK, self.binary));
        }
        joined(&chunks)
    }
}

fn joined(chunks: &[(u32, Vec<u8>)]) -> Vec<u8> {
    let length: usize = 12 + chunks.iter().map(|c| 8 + c.1.len()).sum::<usize>();
    let mut out = b"glTF".to_vec();
    out.extend([2, length as u32].map(u32::to_le_bytes).as_flattened());
    for (kind, bytes) in chunks {
        out.extend([bytes.len() as u32, *kind].map(u32::to_le_bytes).as_flattened());
        out.extend_from_slice(bytes);
    }
    out
}

/// A colour for the `i`-th of several objects, far from its neighbours in hue (golden-angle steps).
pub fn colour(i: usize) -> [f32; 3] {
    let hue = (i as f32 * 0.381_966).fract() * 6.0;
    [0.0f32, 4.0, 2.0].map(|shift| {
        let x = ((hue + shift) % 6.0 - 3.0).abs() - 1.0;
        0.25 + 0.6 * x.clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;

    #[test]
    fn the_container_is_whole_and_its_arrays_are_where_it_says() {
        let vertices = [[-2., 0., 0.5], [1., 0., 0.], [0., 1., 0.]].map(Point::from_array).to_vec();
        let mesh = TriangleMesh { vertices, triangles: vec![[0, 1, 2]] };
        let bytes = encode(&[("a", colour(0), &mesh), ("none", colour(1), &TriangleMesh::default())]);
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let json: Value = serde_json::from_slice(&bytes[20..20 + word(12)]).expect("JSON");
        let binary = &bytes[20 + word(12) + 8..];
        assert_eq!(json["meshes"].as_array().map(Vec::len), Some(1));
        assert_eq!(json["buffers"][0]["byteLength"], binary.len());
        let found: Vec<f64> =
            json["accessors"][0]["min"].as_array().expect("bounds").iter().filter_map(Value::as_f64).collect();
        assert_eq!(found, [-2.0, 0.0, 0.0]);
        let view = &json["bufferViews"][2];
        let at = view["byteOffset"].as_u64().expect("offset") as usize;
        assert_eq!(binary[at..at + 12], [0u32, 1, 2].map(u32::to_le_bytes).concat());
    }
}
