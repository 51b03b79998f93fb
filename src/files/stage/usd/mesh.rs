//! `UsdGeomMesh` as polygons.

use glam::DMat4;

use super::value::Values;
use crate::files::stage::{
    Problem,
    curves::Spread,
    polygons::{AtCorners, PolygonMesh},
};

/// Texture coordinates go by many names; the first of these that a mesh has counts, before all others.
const UV_NAMES: [&str; 5] = ["st", "UVMap", "uv", "map1", "st0"];

/// Names of all sets of texture coordinates of a mesh, the usual one first.
fn uv_sets(values: &Values<'_>) -> Result<Vec<String>, Problem> {
    let mut sets = Vec::new();
    for name in values.prim.property_names()? {
        let Some(own) = name.as_str().strip_prefix("primvars:").filter(|own| !own.contains(':')) else { continue };
        let kind = values.prim.attribute(name.as_str()).type_name()?;
        let is_meant = kind.is_some_and(|kind| kind.as_str().starts_with("texCoord2"));
        if is_meant || (UV_NAMES.contains(&own) && values.pairs(name.as_str())?.is_some()) {
            sets.push(own.to_owned());
        }
    }
    let place = |set: &String| UV_NAMES.iter().position(|name| name == set).unwrap_or(UV_NAMES.len());
    sets.sort_by_cached_key(|set| (place(set), set.clone()));
    Ok(sets)
}

/// Gives a mesh the texture coordinates of a set, or the usual ones.
fn set_uvs(values: &Values<'_>, mesh: &mut PolygonMesh, asked: Option<&str>) -> Result<(), Problem> {
    let sets = uv_sets(values)?;
    let Some(chosen) = mesh.choose_uvs(values.prim.path().as_str(), &sets, asked)? else { return Ok(()) };
    let name = format!("primvars:{}", sets[chosen]);
    let Some(uvs) = values.pairs(&name)? else { return Ok(()) };
    let spread = at_corners(values, &name, uvs, mesh, Spread::Constant)?;
    mesh.set_uvs(spread).map_err(|p| Problem::new(format!("`{name}`: {}", p.text)))
}

/// Reads one prim into the space of the stage, with the texture coordinates of this name, if one is given.
pub(super) fn read(values: &Values<'_>, to_stage: &DMat4, uv: Option<&str>) -> Result<PolygonMesh, Problem> {
    let points = values.points()?;
    let counts = values.integers("faceVertexCounts")?.unwrap_or_default();
    let corners = values.integers("faceVertexIndices")?.unwrap_or_default();
    let mut mesh = PolygonMesh::new(points, &counts, &corners)?;
    set_uvs(values, &mut mesh, uv)?;
    for name in ["primvars:normals", "normals"] {
        if let Some(normals) = values.vectors(name)? {
            let spread = at_corners(values, name, normals, &mesh, Spread::Vertex)?;
            mesh.set_normals(&spread);
            break;
        }
    }
    for child in values.prim.children()? {
        let own = Values { prim: &child, time: values.time };
        let is_subset = child.type_name()?.is_some_and(|t| t == "GeomSubset");
        if is_subset && own.token("elementType")?.is_none_or(|e| e == "face") {
            let of_material = own.token("familyName")?.is_some_and(|family| family == "materialBind");
            mesh.add_group(name_of(&child), &own.integers("indices")?.unwrap_or_default(), of_material)?;
        }
    }
    // A material may be bound to all of it.
    if let Some(material) = values.prim.relationship("material:binding").targets()?.first() {
        mesh.group_all(material.as_str().rsplit('/').next().unwrap_or_default());
    }
    mesh.group_the_rest(name_of(values.prim));
    if let Some(holes) = values.integers("holeIndices")?.filter(|holes| !holes.is_empty()) {
        mesh.cut_out(&holes).map_err(|p| Problem::new(format!("`holeIndices`: {}", p.text)))?;
    }
    if values.token("subdivisionScheme")?.is_none_or(|s| s != "none") && mesh.normals.is_empty() {
        mesh.notes.push(format!("{}: a subdivision surface is taken as its control mesh", values.prim.path().as_str()));
    }
    mesh.place(to_stage, values.token("orientation")?.is_some_and(|o| o == "leftHanded"))?;
    Ok(mesh)
}

fn name_of(prim: &openusd::usd::Prim) -> &str {
    prim.path().as_str().rsplit('/').next().unwrap_or_default()
}

/// A primvar's values at every corner of every face.
fn at_corners<T: Copy>(
    values: &Values<'_>,
    name: &str,
    given: Vec<T>,
    mesh: &PolygonMesh,
    otherwise: Spread,
) -> Result<AtCorners<T>, Problem> {
    let spread = values.spread(name, otherwise)?;
    let expected = match spread {
        Spread::Constant => 1,
        Spread::Uniform => mesh.counts.len(),
        Spread::Varying | Spread::Vertex => mesh.points.len(),
        Spread::FaceVarying => mesh.corners.len(),
    };
    let indices = match values.integers(&format!("{name}:indices"))? {
        None => None,
        Some(indices) => {
            let known = |(i, &index): (usize, &i64)| {
                let n = given.len();
                let index = usize::try_from(index).ok().filter(|&i| i < n).map(|i| i as u32);
                index.ok_or_else(|| Problem::new(format!("`{name}:indices`[{i}] is none of {n} values")))
            };
            Some(indices.iter().enumerate().map(known).collect::<Result<Vec<u32>, Problem>>()?)
        }
    };
    let found = indices.as_ref().map_or(given.len(), Vec::len);
    if found != expected {
        let spread = spread.name();
        return Err(Problem::new(format!("{spread} `{name}` should have {expected} values, found {found}")));
    }
    // Which value each corner has, if not simply the next.
    let index = |i: usize| indices.as_ref().map_or(i as u32, |own| own[i]);
    let of_corners = match spread {
        Spread::Constant => Some(vec![index(0); mesh.corners.len()]),
        Spread::Uniform => {
            let of_face = |(face, &count): (usize, &u32)| std::iter::repeat_n(index(face), count as usize);
            Some(mesh.counts.iter().enumerate().flat_map(of_face).collect())
        }
        Spread::Varying | Spread::Vertex => Some(mesh.corners.iter().map(|&c| index(c as usize)).collect()),
        Spread::FaceVarying => indices,
    };
    Ok(AtCorners { values: given, indices: of_corners })
}
