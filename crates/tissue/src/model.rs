//! The constant part of a simulation.

use crate::abutments::{Abutment, Abutments};
use crate::cuts;
use crate::identity;
use crate::membrane::{self, Membranes};
use crate::options::{AttachmentKind, CollisionResponse, Mode, ModelOptions};
use crate::paper::{PaperModel, Shape};
use crate::physical::PhysicalModel;
use crate::physical::elastic::Elastic;
use crate::slabs::Slabs;
use crate::sphere_tree::SphereTree;
use crate::vec3::{six_volume, unit, xyz};
use crate::volumes::Volumes;
use crate::{Material, ModelError, State, validate};
use monro_geometry::{Patient, Point, TetMesh, Vector, bounds};
use std::collections::BTreeMap;

/// A region: a label and what it is made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Region {
    pub(crate) label: u16,
    pub(crate) material: Material,
}

/// A node tied to its rest position by a spring.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tether {
    pub(crate) node: u32,
    /// mN/mm.
    pub(crate) stiffness: f32,
}

/// A node of which some components do not move.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Guide {
    pub(crate) node: u32,
    /// Which of them.
    pub(crate) held: [bool; 3],
}

/// So many elements in a thousand are the finest.
const FINEST: usize = 100;

/// Constants of one mode.
#[derive(Debug, Clone)]
pub(crate) enum Solver {
    Paper(Box<PaperModel>),
    Physical(Box<PhysicalModel>),
}

/// Mesh, materials, attachments and everything derived from them: constant, to be shared between threads.
#[derive(Debug, Clone)]
pub struct Model {
    /// That of no other model in this process: copies have the same.
    pub(crate) id: u64,
    /// Where the model's coordinates start: single precision is then exact to nanometres.
    pub(crate) origin: Point<Patient>,
    /// x, y, z at rest (mm from the origin) and inverse mass (1/kg, 0 when fixed), in the model's order.
    pub(crate) rest: Vec<[f32; 4]>,
    /// Mass of each node, kg, also of the fixed ones.
    pub(crate) mass: Vec<f32>,
    pub(crate) tets: Vec<[u32; 4]>,
    /// Region of each element.
    pub(crate) region: Vec<u8>,
    pub(crate) regions: Vec<Region>,
    pub(crate) membranes: Membranes,
    pub(crate) tethers: Vec<Tether>,
    /// Nodes that lie against a wall.
    pub(crate) abutments: Abutments,
    /// Nodes of which some components do not move, in their order.
    pub(crate) guides: Vec<Guide>,
    pub(crate) tree: SphereTree,
    pub(crate) volumes: Volumes,
    pub(crate) solver: Solver,
    pub(crate) collision: CollisionResponse,
    /// Whole volume at rest, mm3.
    pub(crate) rest_volume: f64,
    /// Largest coordinate at rest, mm from the origin.
    pub(crate) reach: f32,
    /// Edge of the finest elements, mm.
    pub(crate) fine_edge: f64,
    /// Model number of each vertex of the mesh.
    pub(crate) number: Vec<u32>,
    /// Model number of each element of the mesh.
    pub(crate) tet_number: Vec<u32>,
}

impl Model {
    /// Checks the mesh and the options and derives all constants.
    ///
    /// # Errors
    /// The first fault, with the element or vertex named: not finite, inverted, flat, duplicate or isolated parts, a
    /// label without a material, values out of range.
    pub fn new(mesh: &TetMesh, options: &ModelOptions) -> Result<Self, ModelError> {
        validate::mesh(mesh)?;
        validate::options(mesh, options)?;
        let origin = centre(mesh);
        let points: Vec<[f64; 3]> = mesh.vertices.iter().map(|&p| (p - origin).to_array()).collect();
        let slab_of = cuts::slabs(&points, &mesh.tets, &held(points.len(), options));
        let mut order = spatial_order(points.into_iter());
        let border = borders(&mesh.tets, &slab_of);
        order.sort_by_key(|&v| (slab_of[v as usize], border[v as usize]));
        let slabs = Slabs::new(&order.iter().map(|&v| slab_of[v as usize]).collect::<Vec<u32>>());
        if let Some(vertices) = slabs.too_full() {
            return Err(ModelError::Dense { vertices });
        }
        let number = inverse(&order);
        let mut tet_order = spatial_order((0..mesh.tets.len()).map(|t| centroid(mesh, t, origin)));
        // As the vertices: what a slab works on lies together, however thin it is and however long the curve.
        tet_order.sort_by_key(|&t| mesh.tets[t as usize].map(|v| slab_of[v as usize]).into_iter().min());
        let tets: Vec<[u32; 4]> =
            tet_order.iter().map(|&t| mesh.tets[t as usize].map(|v| number[v as usize])).collect();
        let regions: Vec<Region> =
            options.materials.iter().map(|(&label, &material)| Region { label, material }).collect();
        let region: Vec<u8> = tet_order.iter().map(|&t| region_of(&regions, mesh.labels[t as usize])).collect();
        let mut rest: Vec<[f32; 4]> = order.iter().map(|&v| local(mesh.vertices[v as usize], origin)).collect();
        validate::rounded(mesh, (&tets, &tet_order), &rest)?;
        let mass = node_masses(&rest, &tets, &region, &regions);
        for (p, m) in rest.iter_mut().zip(&mass) {
            p[3] = 1.0 / m;
        }
        let (tethers, abutments, guides) = attach(&mut rest, options, &number);
        let membranes = membrane::find(&tets, &region);
        let abutments = Abutments::new(abutments, &membranes, &rest);
        let tree = SphereTree::new(&rest, &tets);
        let volumes = Volumes::new(&tets, &rest);
        let fine_edge = volumes.fine_edge(FINEST);
        let rest_volume = (0..mesh.tets.len()).map(|t| mesh.volume(t)).sum();
        let solver = match options.mode {
            Mode::Paper(o) => {
                let (rest, tets, region, regions) = (&rest, &tets, &region, &regions);
                let shape = Shape { rest, tets, region, regions, membranes: &membranes, slabs: &slabs };
                Solver::Paper(Box::new(PaperModel::new(&shape, &o)))
            }
            Mode::Physical(o) => {
                let of = (&region[..], &regions[..]);
                let mesh = (&tets[..], &membranes);
                let model = PhysicalModel::new((&rest, &mass), mesh, of, &slabs, o.nodal_shear);
                Solver::Physical(Box::new(model))
            }
        };
        let tet_number = inverse(&tet_order);
        let collision = options.collision;
        let reach = rest.iter().flat_map(|p| &p[..3]).fold(0f32, |m, v| m.max(v.abs()));
        Ok(Self {
            id: identity::unique(),
            origin,
            rest,
            mass,
            tets,
            region,
            regions,
            membranes,
            tethers,
            abutments,
            guides,
            tree,
            volumes,
            solver,
            collision,
            rest_volume,
            reach,
            fine_edge,
            number,
            tet_number,
        })
    }

    /// The state in which nothing has happened yet.
    pub fn rest_state(&self) -> State {
        State {
            positions: self.rest.clone(),
            velocities: vec![[0.0; 4]; self.rest.len()],
            pressure: vec![0.0; self.pressures()],
            csf_kpa: 0.0,
            knotted: 0,
            tools: Vec::new(),
            time_s: 0.0,
        }
    }

    /// Patient position of the model's own origin.
    pub const fn origin(&self) -> Point<Patient> {
        self.origin
    }

    /// Number of nodes: the vertices of the mesh.
    pub fn node_count(&self) -> usize {
        self.rest.len()
    }

    /// Number of elements.
    pub fn tet_count(&self) -> usize {
        self.tets.len()
    }

    /// What the solver goes through in an iteration: kind and count.
    pub fn constraint_counts(&self) -> Vec<(&'static str, usize)> {
        match &self.solver {
            Solver::Paper(p) => p.counts(),
            Solver::Physical(p) => p.descent.counts(),
        }
    }

    /// Whole mass, kg.
    pub fn mass_kg(&self) -> f64 {
        self.mass.iter().map(|&m| f64::from(m)).sum()
    }

    /// Whole volume at rest, mm3.
    pub const fn rest_volume_mm3(&self) -> f64 {
        self.rest_volume
    }

    /// Current position of vertex `vertex` of the mesh.
    pub fn position(&self, state: &State, vertex: usize) -> Point<Patient> {
        self.to_patient(state.positions[self.number[vertex] as usize])
    }

    /// Current positions of all vertices in the order of the mesh; `out` is cleared first.
    pub fn positions_into(&self, state: &State, out: &mut Vec<Point<Patient>>) {
        out.clear();
        out.extend(self.number.iter().map(|&n| self.to_patient(state.positions[n as usize])));
    }

    /// Current nodes in the order of the mesh, for an embedding: x, y, z in mm from [`Model::origin`]; `out` is cleared first.
    pub fn nodes_into(&self, state: &State, out: &mut Vec<[f32; 4]>) {
        out.clear();
        out.extend(self.number.iter().map(|&n| state.positions[n as usize]));
    }

    /// Displacement of a vertex of the mesh from rest, mm.
    pub fn displacement(&self, state: &State, vertex: usize) -> Vector<Patient> {
        let n = self.number[vertex] as usize;
        Vector::from_array(core::array::from_fn(|a| f64::from(state.positions[n][a]) - f64::from(self.rest[n][a])))
    }

    /// Velocity of a vertex of the mesh, mm/s.
    pub fn velocity(&self, state: &State, vertex: usize) -> Vector<Patient> {
        let v = state.velocities[self.number[vertex] as usize];
        Vector::new(v[0].into(), v[1].into(), v[2].into())
    }

    /// Moves a fixed vertex of the mesh to a place of the caller's choosing: how a node is driven from frame to frame. Of a
    /// guided vertex only the held components are moved. Returns whether it is fixed or guided; a free vertex is left
    /// alone, and so is one sent to a point that is not finite.
    pub fn place_fixed(&self, state: &mut State, vertex: usize, to: Point<Patient>) -> bool {
        let n = self.number[vertex] as usize;
        let guide = self.guides.binary_search_by_key(&n, |g| g.node as usize).ok();
        let held = guide.map_or([self.rest[n][3] == 0.0; 3], |g| self.guides[g].held);
        let to = Some(local(to, self.origin)).filter(|_| to.is_finite());
        let axes = (0..3).filter(|&a| held[a]);
        to.map(|to| axes.map(|a| state.positions[n][a] = to[a]).count()).is_some_and(|moved| moved > 0)
    }

    /// Current volume of the elements whose label `keep` accepts, mm3.
    pub fn volume_mm3(&self, state: &State, keep: impl Fn(u16) -> bool) -> f64 {
        let chosen = (0..self.tets.len()).filter(|&t| keep(self.regions[self.region[t] as usize].label));
        chosen.map(|t| f64::from(six_volume(self.corners(state, t))) / 6.0).sum()
    }

    /// Whether forces come in mN (physical mode) or are only relative (paper mode).
    pub(crate) const fn forces_are_physical(&self) -> bool {
        match self.solver {
            Solver::Paper(_) => false,
            Solver::Physical(_) => true,
        }
    }

    /// What an element is made of.
    pub(crate) fn material_of(&self, tet: u32) -> &Material {
        &self.regions[self.region[tet as usize] as usize].material
    }

    fn pressures(&self) -> usize {
        match &self.solver {
            Solver::Paper(_) => 0,
            Solver::Physical(p) => p.descent.patches(),
        }
    }

    /// The energy of physical mode in double precision, made anew: stepping does not need it, and it takes about 250
    /// bytes for each element.
    pub(crate) fn elastic(&self) -> Option<Elastic> {
        match &self.solver {
            Solver::Paper(_) => None,
            Solver::Physical(p) => {
                let (mesh, of) = ((&self.tets[..], &self.membranes), (&self.region[..], &self.regions[..]));
                Some(Elastic::new(&self.rest, mesh, of, p.nodal_shear))
            }
        }
    }

    pub(crate) fn corners(&self, state: &State, tet: usize) -> [[f32; 3]; 4] {
        self.tets[tet].map(|v| xyz(state.positions[v as usize]))
    }

    pub(crate) fn to_patient(&self, p: [f32; 4]) -> Point<Patient> {
        self.origin + Vector::new(p[0].into(), p[1].into(), p[2].into())
    }
}

/// Vertices of the mesh that are fixed.
fn held(vertices: usize, options: &ModelOptions) -> Vec<bool> {
    let mut held = vec![false; vertices];
    let fixed = options.attachments.iter().filter(|a| a.kind == AttachmentKind::Fixed);
    fixed.for_each(|a| held[a.node as usize] = true);
    held
}

fn centre(mesh: &TetMesh) -> Point<Patient> {
    let [low, high] = bounds(mesh.vertices.iter().map(|p| p.to_array())).unwrap_or_default();
    // Whole millimetres: subtracting them loses nothing.
    Point::from_array(core::array::from_fn(|a| (0.5 * (low[a] + high[a])).round()))
}

fn local(p: Point<Patient>, origin: Point<Patient>) -> [f32; 4] {
    let d = p - origin;
    [d.x as f32, d.y as f32, d.z as f32, 0.0]
}

fn centroid(mesh: &TetMesh, t: usize, origin: Point<Patient>) -> [f64; 3] {
    let corners = mesh.corners(t);
    core::array::from_fn(|a| corners.iter().map(|&p| (p - origin).to_array()[a]).sum::<f64>() / 4.0)
}

/// Indices along a Morton curve, so that neighbours in space are neighbours in memory.
fn spatial_order(points: impl Iterator<Item = [f64; 3]>) -> Vec<u32> {
    let points: Vec<[f64; 3]> = points.collect();
    let reach = points.iter().flatten().fold(0f64, |m, v| m.max(v.abs())).max(f64::MIN_POSITIVE);
    let cell = |v: f64| ((v / reach * 0.5 + 0.5) * 1023.0) as u64;
    let spread = |v: u64| (0..10).fold(0u64, |s, bit| s | (((v >> bit) & 1) << (3 * bit)));
    let key = |p: &[f64; 3]| spread(cell(p[0])) | spread(cell(p[1])) << 1 | spread(cell(p[2])) << 2;
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_by_key(|&i| (key(&points[i as usize]), i));
    order
}

/// Whether each vertex has a neighbour in the slab before (-1) or after (1) its own, or in neither.
fn borders(tets: &[[u32; 4]], slab_of: &[u32]) -> Vec<i8> {
    let mut out = vec![0; slab_of.len()];
    for tet in tets {
        for (v, n) in tet.iter().flat_map(|&v| tet.iter().map(move |&n| (v as usize, n as usize))) {
            match slab_of[n].cmp(&slab_of[v]) {
                core::cmp::Ordering::Less => out[v] = -1,
                core::cmp::Ordering::Equal => {}
                core::cmp::Ordering::Greater => out[v] = 1,
            }
        }
    }
    out
}

fn inverse(order: &[u32]) -> Vec<u32> {
    let mut out = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        out[old as usize] = new as u32;
    }
    out
}

fn region_of(regions: &[Region], label: u16) -> u8 {
    // Validation has made sure that every label has a material.
    regions.iter().position(|r| r.label == label).unwrap_or(0) as u8
}

fn node_masses(rest: &[[f32; 4]], tets: &[[u32; 4]], region: &[u8], regions: &[Region]) -> Vec<f32> {
    let mut mass = vec![0f64; rest.len()];
    for (tet, &r) in tets.iter().zip(region) {
        let volume = f64::from(six_volume(tet.map(|v| xyz(rest[v as usize])))) / 6.0;
        // kg/m3 to kg/mm3.
        let quarter = volume * regions[r as usize].material.density_kg_m3 * 1e-9 / 4.0;
        tet.iter().for_each(|&v| mass[v as usize] += quarter);
    }
    mass.into_iter().map(|m| m as f32).collect()
}

fn attach(rest: &mut [[f32; 4]], options: &ModelOptions, number: &[u32]) -> (Vec<Tether>, Vec<Abutment>, Vec<Guide>) {
    let (mut tethers, mut abutments) = (Vec::new(), Vec::new());
    let mut held_of = BTreeMap::<u32, [bool; 3]>::new();
    for a in &options.attachments {
        let node = number[a.node as usize];
        match a.kind {
            AttachmentKind::Fixed => rest[node as usize][3] = 0.0,
            AttachmentKind::Spring { stiffness_mn_per_mm } => {
                tethers.push(Tether { node, stiffness: stiffness_mn_per_mm as f32 });
            }
            AttachmentKind::Abutting { outward, drag_per_s } => {
                // Validation has made sure that it has a length.
                let outward = unit(outward.map(|v| v as f32)).unwrap_or_default();
                abutments.push(Abutment { node, outward, drag: drag_per_s as f32 });
            }
            AttachmentKind::Guided { held } => {
                let all = held_of.entry(node).or_default();
                (0..3).for_each(|a| all[a] |= held[a]);
            }
        }
    }
    // Held along every axis is fixed, and what is fixed needs no guide.
    let mut guides: Vec<Guide> = held_of.into_iter().map(|(node, held)| Guide { node, held }).collect();
    guides.iter().filter(|g| g.held == [true; 3]).for_each(|g| rest[g.node as usize][3] = 0.0);
    guides.retain(|g| rest[g.node as usize][3] > 0.0);
    abutments.retain(|a| rest[a.node as usize][3] > 0.0);
    (tethers, abutments, guides)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{Attachment, PaperOptions};
    use monro_geometry::TetMeshError;

    /// A block of cubes of `size` mm, each cut into six tetrahedra around its diagonal.
    pub(crate) fn block(cells: [usize; 3], size: f64) -> TetMesh {
        let n = cells.map(|c| c + 1);
        let at = |i: usize, j: usize, k: usize| (i + n[0] * (j + n[1] * k)) as u32;
        let mut mesh = TetMesh::default();
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    mesh.vertices.push(Point::new(i as f64 * size, j as f64 * size, k as f64 * size));
                }
            }
        }
        const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        for k in 0..cells[2] {
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    for (p, path) in PATHS.iter().enumerate() {
                        let mut c = [i, j, k];
                        let mut tet = [at(c[0], c[1], c[2]); 4];
                        for (corner, &axis) in tet[1..].iter_mut().zip(path) {
                            c[axis] += 1;
                            *corner = at(c[0], c[1], c[2]);
                        }
                        if p >= 3 {
                            tet.swap(1, 2);
                        }
                        mesh.tets.push(tet);
                        mesh.labels.push(4);
                    }
                }
            }
        }
        mesh
    }

    pub(crate) fn paper_options() -> ModelOptions {
        ModelOptions {
            mode: Mode::Paper(PaperOptions::default()),
            materials: BTreeMap::from([(4, Material::BRAIN), (5, Material::VENTRICLE)]),
            attachments: Vec::new(),
            collision: CollisionResponse::Insertion,
        }
    }

    #[test]
    fn mass_and_volume_are_those_of_the_block_and_vertices_keep_their_places() {
        let mesh = block([3, 2, 4], 5.0);
        mesh.validate().expect("block");
        let model = Model::new(&mesh, &paper_options()).expect("model");
        let volume = 15.0 * 10.0 * 20.0;
        assert!((model.rest_volume_mm3() / volume - 1.0).abs() < 1e-12);
        assert!((model.mass_kg() / (volume * 1040e-9) - 1.0).abs() < 1e-6);
        let state = model.rest_state();
        for (v, p) in mesh.vertices.iter().enumerate() {
            assert!(model.position(&state, v).distance(*p) < 1e-5);
        }
        assert!((model.volume_mm3(&state, |l| l == 4) / volume - 1.0).abs() < 1e-6);
    }

    #[test]
    fn faulty_meshes_and_options_are_refused_by_name() {
        let good = block([2, 1, 1], 1.0);
        let refuse = |mesh: &TetMesh, options: &ModelOptions| Model::new(mesh, options).err();
        let o = paper_options();
        let mut m = good.clone();
        m.vertices[3].y = f64::NAN;
        assert!(matches!(refuse(&m, &o), Some(ModelError::Mesh(TetMeshError::NotFinite(3)))));
        let mut m = good.clone();
        m.tets[4].swap(0, 1);
        assert!(matches!(refuse(&m, &o), Some(ModelError::Mesh(TetMeshError::Inverted { tet: 4, .. }))));
        let mut m = good.clone();
        m.vertices.push(Point::new(9.0, 9.0, 9.0));
        let refused = |m: &TetMesh, by: TetMeshError| assert_eq!(refuse(m, &o), Some(ModelError::Mesh(by)));
        refused(&m, TetMeshError::Unused { vertex: 12, count: 1, vertices: 13 });
        let mut m = good.clone();
        m.tets.push(m.tets[2]);
        m.labels.push(4);
        refused(&m, TetMeshError::Duplicate { first: 2, second: 12 });
        let crowded = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.2, 0.2, 2.0]];
        let m = TetMesh {
            vertices: crowded.map(Point::from_array).to_vec(),
            tets: vec![[0, 1, 2, 3], [0, 2, 1, 4], [0, 1, 2, 5]],
            labels: vec![4; 3],
        };
        let by = refuse(&m, &o);
        assert!(matches!(by, Some(ModelError::Mesh(TetMeshError::Face { face: [0, 1, 2], .. }))), "{by:?}");
        let mut m = good.clone();
        m.labels[7] = 99;
        assert_eq!(refuse(&m, &o), Some(ModelError::NoMaterial { label: 99, tets: 1, tet: 7 }));
        assert_eq!(refuse(&TetMesh::default(), &o), Some(ModelError::Empty));
        let mut bad = o.clone();
        bad.materials.insert(4, Material { poisson: 0.5, ..Material::BRAIN });
        assert!(matches!(refuse(&good, &bad), Some(ModelError::Material { label: 4, .. })));
        let mut bad = o;
        bad.attachments.push(Attachment { node: 12, kind: AttachmentKind::Fixed });
        assert_eq!(refuse(&good, &bad), Some(ModelError::Attachment { attachment: 0, node: 12, vertices: 12 }));
    }

    #[test]
    fn two_elements_on_one_side_of_a_face_were_simulated_as_if_they_were_neighbours() {
        let good = block([2, 1, 1], 1.0);
        let refuse = |mesh: &TetMesh| Model::new(mesh, &paper_options()).err();
        // Another element on the first one's outer face, reaching to the same side.
        let mut m = good.clone();
        let [a, b, c, d] = m.tets[0];
        let middle = m.corners(0).map(|p| p.to_array());
        let inside = core::array::from_fn(|k| middle.iter().map(|p| p[k]).sum::<f64>() / 4.0);
        m.vertices.push(Point::from_array(inside));
        for face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
            let mut m = m.clone();
            m.tets.push([face[0], face[1], face[2], 12]);
            m.labels.push(4);
            if m.volume(12) < 0.0 {
                m.tets[12].swap(0, 1);
            }
            let by = refuse(&m);
            assert!(
                matches!(by, Some(ModelError::Mesh(TetMeshError::Overlap { .. } | TetMeshError::Face { .. }))),
                "{by:?}"
            );
        }
    }

    #[test]
    fn a_flat_element_and_twin_vertices_are_refused_whatever_the_unit() {
        for unit in [1e-3, 1.0, 1e3] {
            let mut m = block([1, 1, 1], unit);
            m.vertices[0] = m.vertices[1] + (m.vertices[0] - m.vertices[1]) * 1e-12;
            let refused = Model::new(&m, &paper_options()).err();
            assert!(matches!(refused, Some(ModelError::Flat { .. })), "{refused:?}");
        }
        let mut m = block([1, 1, 1], 1.0);
        let copy = block([1, 1, 1], 1.0);
        m.vertices.extend(copy.vertices);
        m.tets.extend(copy.tets.iter().map(|t| t.map(|v| v + 8)));
        m.labels.extend(copy.labels);
        let refused = Model::new(&m, &paper_options()).err();
        assert_eq!(refused, Some(ModelError::DuplicateVertex { first: 0, second: 8 }));
    }

    /// Single precision counts in 8e-6 mm a hundred millimetres from the middle: an element of less had no volume, and each frame was
    /// taken back.
    #[test]
    fn an_element_that_rounding_leaves_no_volume_was_taken() {
        let mut mesh = block([1, 1, 1], 1.0);
        let z = |t: usize, k: usize| mesh.vertices[mesh.tets[t][k] as usize].z;
        let on_floor = |t: usize| (0..4).find(|&i| (0..4).all(|k| k == i || z(t, k) < 0.5)).map(|i| (t, i));
        let (tet, high) = (0..6).find_map(on_floor).expect("an element with a face on the floor");
        let corners = mesh.tets[tet];
        let mut middle = [0.0, 0.0, 4e-6];
        for k in (0..4).filter(|&k| k != high) {
            let p = mesh.vertices[corners[k] as usize];
            (middle[0], middle[1]) = (middle[0] + p.x / 3.0, middle[1] + p.y / 3.0);
        }
        let inner = mesh.vertices.len() as u32;
        mesh.vertices.push(Point::from_array(middle));
        mesh.tets.remove(tet);
        mesh.labels.remove(tet);
        for k in 0..4 {
            let mut part = corners;
            part[k] = inner;
            mesh.tets.push(part);
            mesh.labels.push(4);
        }
        assert!(Model::new(&mesh, &paper_options()).is_ok(), "near the middle it has a volume");
        let (far, first) = (block([1, 1, 1], 1.0), mesh.vertices.len() as u32);
        mesh.vertices.extend(far.vertices.iter().map(|p| Point::new(p.x, p.y, p.z + 400.0)));
        mesh.tets.extend(far.tets.iter().map(|t| t.map(|v| v + first)));
        mesh.labels.extend(&far.labels);
        let refused = Model::new(&mesh, &paper_options()).err();
        assert!(matches!(refused, Some(ModelError::Flat { tet, .. }) if tet >= 5), "{refused:?}");
    }
}
