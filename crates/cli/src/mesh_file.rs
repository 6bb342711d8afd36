//! Mesh files by their extension.

use anyhow::{Context, Result, bail};
use monro_case::vtu::{self, UnstructuredGrid};
use monro_case::{Rounding, Space, glb, msh, obj, ply, stl};
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

/// The bytes of a file and what should be known of them.
#[derive(Debug)]
pub(crate) struct Encoded {
    pub(crate) bytes: Vec<u8>,
    pub(crate) remark: Option<String>,
}

impl From<Vec<u8>> for Encoded {
    fn from(bytes: Vec<u8>) -> Self {
        Self { bytes, remark: None }
    }
}

/// A mesh and what should be known of it.
#[derive(Debug)]
pub(crate) struct Read {
    pub(crate) mesh: AnyMesh,
    pub(crate) remarks: Vec<String>,
}

impl Read {
    fn of_grid(mut grid: UnstructuredGrid) -> Result<Self> {
        let unlabelled = grid.labelled().map(|others| no_labels(&others));
        let remarks = turned(grid.space).into_iter().chain(unlabelled).collect();
        Ok(Self { mesh: AnyMesh::Tetrahedra(grid.to_mesh()?), remarks })
    }

    /// Refuses a mesh of nothing, and one whose elements do not fit together.
    fn sound(self) -> Result<Self> {
        match &self.mesh {
            AnyMesh::Tetrahedra(m) if m.tets.is_empty() => {
                bail!("it holds {} node(s), but no tetrahedron", m.vertices.len())
            }
            AnyMesh::Surface(m) if m.triangles.is_empty() => {
                bail!("it holds {} vertices, but no triangle", m.vertices.len())
            }
            AnyMesh::Tetrahedra(m) => m.check_joined()?,
            AnyMesh::Surface(m) => m.check_sound()?,
        }
        Ok(self)
    }
}

impl From<msh::Imported> for Read {
    fn from(read: msh::Imported) -> Self {
        let unused = read.unused.first().map(|first| {
            let n = read.unused.len();
            format!("{n} node(s) of no tetrahedron are left out, the first with tag {first}")
        });
        let others =
            read.others.iter().map(|(name, n)| format!("{n} {name} are left out: only linear tetrahedra are read"));
        let unlabelled = read
            .unlabelled
            .then(|| one_label("no tetrahedron has a physical group, element data \"label\" or an entity"));
        let remarks = unused.into_iter().chain(others).chain(unlabelled).chain(read.remarks).collect();
        Self { mesh: AnyMesh::Tetrahedra(read.mesh), remarks }
    }
}

/// What is said of a mesh without labels, and why it has none.
fn one_label(why: &str) -> String {
    format!("{why}: all elements have the label 1")
}

/// What is said of a grid without labels but with these arrays.
fn no_labels(others: &[String]) -> String {
    if others.is_empty() {
        return one_label("there is no cell array \"label\", nor any other");
    }
    let names = others.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    one_label(&format!("there is no cell array \"label\", only {names} (rename the one that holds the labels)"))
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

    /// Reads a mesh and refuses what is plainly broken, with the element and the reason.
    pub(crate) fn read(path: &Path) -> Result<Read> {
        let format = Self::of(path).with_context(|| format!("{} is no mesh by its extension", path.display()))?;
        let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let mesh: Result<Read> = match format {
            Self::Vtu => vtu::decode(&bytes).map_err(anyhow::Error::from).and_then(Read::of_grid),
            Self::Msh => msh::decode(&bytes).map(Read::from).map_err(Into::into),
            Self::Ply => ply::decode_stated(&bytes).map(Read::from).map_err(Into::into),
            Self::Stl => stl::decode_stated(&bytes).map(Read::from).map_err(Into::into),
            Self::Obj | Self::Glb => {
                bail!(
                    "{}: .obj and .glb are written, not read; give the mesh as .vtu, .msh, .ply or .stl",
                    path.display()
                )
            }
        };
        mesh.and_then(Read::sound).with_context(|| format!("{} is refused", path.display()))
    }

    /// A mesh in this format. Of tetrahedra the surface formats hold the outer surface (.ply, .stl) or the closed surface of
    /// each label as an object (.obj, .glb).
    pub(crate) fn encode(self, mesh: &AnyMesh) -> Result<Encoded> {
        let objects = match (self, mesh) {
            (Self::Vtu, AnyMesh::Tetrahedra(m)) => return Ok(vtu::encode(&UnstructuredGrid::from_mesh(m)).into()),
            (Self::Msh, AnyMesh::Tetrahedra(m)) => {
                return Ok(Encoded { bytes: msh::encode(m), remark: unnumbered(m) });
            }
            (Self::Vtu | Self::Msh, AnyMesh::Surface(_)) => {
                bail!("a surface has no tetrahedra; write it as .ply, .stl, .obj or .glb")
            }
            (Self::Ply | Self::Stl, AnyMesh::Tetrahedra(m)) => vec![("surface".into(), m.surface(|_| true))],
            (Self::Obj | Self::Glb, AnyMesh::Tetrahedra(m)) => by_label(m),
            (_, AnyMesh::Surface(m)) => vec![("surface".into(), m.clone())],
        };
        let remark = objects.iter().map(|(_, m)| self.rounded(m)).find_map(Result::transpose).transpose()?;
        let bytes = match (self, &objects[..]) {
            (Self::Ply, [(_, m)]) => ply::encode(m, None),
            (Self::Stl, [(_, m)]) => stl::encode(m),
            _ => self.objects(&objects),
        };
        Ok(Encoded { bytes, remark })
    }

    /// What single precision, which STL and GLB are bound to, does to a surface: a remark, or a refusal where nothing useful
    /// would be left.
    fn rounded(self, mesh: &TriangleMesh) -> Result<Option<String>> {
        let rounding = Rounding::of(mesh);
        if !matches!(self, Self::Stl | Self::Glb) || rounding.is_fine() {
            return Ok(None);
        }
        let told = format!(
            "this format rounds coordinates to single precision: points move by up to {:.2e} mm, the mean edge is {:.2e} mm",
            rounding.moved, rounding.mean_edge
        );
        let way_out = "write .ply or .obj, or move the mesh towards the origin";
        match rounding.collapsed {
            Some(triangle) => bail!("{told}, and triangle {triangle} loses a corner; {way_out}"),
            None => Ok(Some(format!("{told}; {way_out}"))),
        }
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

/// What Gmsh makes of a physical group 0.
fn unnumbered(mesh: &TetMesh) -> Option<String> {
    mesh.labels.contains(&0).then(|| {
        "label 0 becomes a physical group 0, which Gmsh takes for one without a number: it numbers it anew and gives its name \
         to another label; number the labels from 1 if Gmsh is to read the file (this program and meshio read it as it is)"
            .to_owned()
    })
}

/// The closed surface of each label.
fn by_label(mesh: &TetMesh) -> Vec<(String, TriangleMesh)> {
    mesh.label_counts().into_iter().map(|(l, _)| (format!("label_{l}"), mesh.surface(|x| x == l))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which group a label came from was known, and told to nobody.
    #[test]
    fn what_is_remarked_of_groups_while_reading_is_passed_on() {
        let mesh = TetMesh { vertices: Vec::new(), tets: Vec::new(), labels: Vec::new() };
        let remarks = vec!["volumes in several physical groups".to_owned()];
        let read = msh::Imported { mesh, unused: vec![7], unlabelled: false, others: Vec::new(), remarks };
        let told = Read::from(read).remarks;
        assert!(told.len() == 2 && told[1].contains("several physical groups"), "{told:?}");
    }
}
