//! Mesh files by their extension.

use anyhow::{Context, Result, bail};
use monro_case::vtu::{self, UnstructuredGrid};
use monro_case::{Space, glb, msh, obj, ply, stl};
use monro_geometry::{TetMesh, TriangleMesh};
use std::fs;
use std::path::Path;

/// A format of meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Vtu,
    Msh,
    Ply,
    Stl,
    Obj,
    Glb,
}

/// What a mesh file holds.
#[derive(Debug)]
pub(crate) enum AnyMesh {
    Tetrahedra(TetMesh),
    Surface(TriangleMesh),
}

/// A mesh and what should be known of it.
#[derive(Debug)]
pub(crate) struct Read {
    pub(crate) mesh: AnyMesh,
    pub(crate) remarks: Vec<String>,
}

impl Read {
    fn of_grid(grid: UnstructuredGrid) -> Result<Self> {
        let remarks = turned(grid.space).into_iter().collect();
        Ok(Self { mesh: AnyMesh::Tetrahedra(grid.to_mesh()?), remarks })
    }

    /// Refuses a mesh of nothing.
    fn with_something(self) -> Result<Self> {
        match &self.mesh {
            AnyMesh::Tetrahedra(m) if m.tets.is_empty() => {
                bail!("it holds {} node(s), but no tetrahedron", m.vertices.len())
            }
            AnyMesh::Surface(m) if m.triangles.is_empty() => {
                bail!("it holds {} vertices, but no triangle", m.vertices.len())
            }
            _ => Ok(self),
        }
    }
}

impl From<msh::Imported> for Read {
    fn from(read: msh::Imported) -> Self {
        let first = read.unused.first().map(|first| (first, read.unused.len()));
        let remark =
            first.map(|(first, n)| format!("{n} node(s) of no tetrahedron are left out, the first with tag {first}"));
        Self { mesh: AnyMesh::Tetrahedra(read.mesh), remarks: remark.into_iter().collect() }
    }
}

impl From<(TriangleMesh, Option<Space>)> for Read {
    fn from((mesh, space): (TriangleMesh, Option<Space>)) -> Self {
        Self { mesh: AnyMesh::Surface(mesh), remarks: turned(space).into_iter().collect() }
    }
}

/// What is said of a file whose axes are not LPS.
fn turned(space: Option<Space>) -> Option<String> {
    let space = space.filter(|s| *s != Space::Lps)?;
    Some(format!("the file says SPACE={}: x and y were turned to LPS", space.name()))
}

impl Format {
    /// By the extension; `None` for any other.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        Some(match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "vtu" => Self::Vtu,
            "msh" => Self::Msh,
            "ply" => Self::Ply,
            "stl" => Self::Stl,
            "obj" => Self::Obj,
            "glb" => Self::Glb,
            _ => return None,
        })
    }

    /// By the extension of a file to write.
    pub(crate) fn to_write(path: &Path) -> Result<Self> {
        let known = "tetrahedra are written as .vtu or .msh, their surfaces as .ply, .stl, .obj or .glb";
        Self::of(path).with_context(|| format!("{}: {known}", path.display()))
    }

    /// Reads and checks a mesh; `None` when the file is no mesh by its extension.
    pub(crate) fn read(path: &Path) -> Result<Option<Read>> {
        let Some(format) = Self::of(path) else { return Ok(None) };
        let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let mesh: Result<Read> = match format {
            Self::Vtu => vtu::decode(&bytes).map_err(anyhow::Error::from).and_then(Read::of_grid),
            Self::Msh => msh::decode(&bytes).map(Read::from).map_err(Into::into),
            Self::Ply => ply::decode_stated(&bytes).map(Read::from).map_err(Into::into),
            Self::Stl => stl::decode_stated(&bytes).map(Read::from).map_err(Into::into),
            Self::Obj | Self::Glb => bail!("{}: .obj and .glb are written, not read", path.display()),
        };
        mesh.and_then(Read::with_something).with_context(|| format!("{} is refused", path.display())).map(Some)
    }

    /// The bytes of a mesh in this format. Of tetrahedra the surface formats hold the outer surface (.ply, .stl) or the
    /// closed surface of each label as an object (.obj, .glb).
    pub(crate) fn encode(self, mesh: &AnyMesh) -> Result<Vec<u8>> {
        Ok(match (self, mesh) {
            (Self::Vtu, AnyMesh::Tetrahedra(m)) => vtu::encode(&UnstructuredGrid::from_mesh(m)),
            (Self::Msh, AnyMesh::Tetrahedra(m)) => msh::encode(m),
            (Self::Vtu | Self::Msh, AnyMesh::Surface(_)) => {
                bail!("a surface has no tetrahedra; write it as .ply, .stl, .obj or .glb")
            }
            (Self::Ply, AnyMesh::Tetrahedra(m)) => ply::encode(&m.surface(|_| true), None),
            (Self::Stl, AnyMesh::Tetrahedra(m)) => stl::encode(&m.surface(|_| true)),
            (Self::Ply, AnyMesh::Surface(m)) => ply::encode(m, None),
            (Self::Stl, AnyMesh::Surface(m)) => stl::encode(m),
            (Self::Obj | Self::Glb, AnyMesh::Tetrahedra(m)) => self.objects(&by_label(m)),
            (Self::Obj | Self::Glb, AnyMesh::Surface(m)) => self.objects(&[("surface".into(), m.clone())]),
        })
    }

    fn objects(self, objects: &[(String, TriangleMesh)]) -> Vec<u8> {
        if self == Self::Obj {
            let list: Vec<_> = objects.iter().map(|(name, mesh)| (name.as_str(), mesh)).collect();
            return obj::encode(&list);
        }
        let coloured = objects.iter().enumerate().map(|(i, (name, mesh))| (name.as_str(), glb::colour(i), mesh));
        glb::encode(&coloured.collect::<Vec<_>>())
    }
}

/// The closed surface of each label.
fn by_label(mesh: &TetMesh) -> Vec<(String, TriangleMesh)> {
    let mut labels = mesh.labels.clone();
    labels.sort_unstable();
    labels.dedup();
    labels.into_iter().map(|l| (format!("label_{l}"), mesh.surface(|x| x == l))).collect()
}
