"""Makes garment.usda, garment.abc and colors.usda beside it: `python make_garment.py`.

usd-core 26.11 and alembic3d 1.8.12.1 (`pip install usd-core==26.11 alembic3d==1.8.12.1`).
"""

from math import cos, pi, sin

import abc_arrays as arrays
from alembic3d.Abc import OArchive
from alembic3d.AbcGeom import (GeometryScope, OFaceSetSchemaSample, OPolyMesh, OPolyMeshSchemaSample,
                             OV2fGeomParamSample)
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

AROUND, RINGS, RADIUS, STEP = 12, 3, 2.0, 1.0


def tube(z_up, shift=0.0):
    """A tube of 12 x 3 quads, centimetres, two of which are one hexagon: points, counts, corners, st at corners."""
    points = []
    for ring in range(RINGS + 1):
        for k in range(AROUND):
            turn = 2 * pi * k / AROUND
            x, y, h = RADIUS * cos(turn), RADIUS * sin(turn), ring * STEP + shift
            points.append((x, y, h) if z_up else (x, h, -y))
    side = 2 * pi * RADIUS / AROUND
    counts, corners, st, hem = [], [], [], []

    def add(places):
        counts.append(len(places))
        for k, ring in places:
            corners.append(ring * AROUND + k % AROUND)
            st.append((k * side / 40, ring * STEP / 40))

    for ring in range(RINGS):
        k = 0
        while k < AROUND:
            if ring == 0:
                hem.append(len(counts))
            if ring == 1 and k == 4:
                add([(4, 1), (5, 1), (6, 1), (6, 2), (5, 2), (4, 2)])
                k += 2
            else:
                add([(k, ring), (k + 1, ring), (k + 1, ring + 1), (k, ring + 1)])
                k += 1
    return points, counts, corners, st, hem


def usd():
    made = Usd.Stage.CreateNew("garment.usda")
    UsdGeom.SetStageMetersPerUnit(made, 0.01)
    UsdGeom.SetStageUpAxis(made, "Z")
    made.SetStartTimeCode(1)
    made.SetEndTimeCode(3)
    points, counts, corners, st, hem = tube(True)
    mesh = UsdGeom.Mesh.Define(made, "/figure/tube")
    mesh.CreatePointsAttr().Set(points, 1)
    mesh.GetPointsAttr().Set(tube(True, 1.0)[0], 3)
    mesh.CreateFaceVertexCountsAttr(counts)
    mesh.CreateFaceVertexIndicesAttr(corners)
    mesh.CreateSubdivisionSchemeAttr("none")
    # Indices that share nothing, as many exporters write them.
    var = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    var.Set(Vt.Vec2fArray(st))
    var.SetIndices(Vt.IntArray(list(range(len(st)))))
    subset = UsdGeom.Subset.Define(made, "/figure/tube/hem")
    subset.CreateElementTypeAttr("face")
    subset.CreateIndicesAttr(hem)
    bare = UsdGeom.Mesh.Define(made, "/figure/bare")
    bare.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    bare.CreateFaceVertexCountsAttr([3])
    bare.CreateFaceVertexIndicesAttr([0, 1, 2])
    made.GetRootLayer().Save()


def abc():
    points, counts, corners, st, hem = tube(False)

    archive = OArchive("garment.abc")
    mesh = OPolyMesh(archive.getTop(), "tube")
    # Alembic winds faces clockwise.
    def turned(values):
        out, at = [], 0
        for count in counts:
            out += values[at:at + count][::-1]
            at += count
        return out

    uv = OV2fGeomParamSample(
        arrays.pairs(turned(st)), arrays.indices(range(len(st))), GeometryScope.kFacevaryingScope)
    integers = arrays.integers
    mesh.getSchema().set(OPolyMeshSchemaSample(arrays.points(points), integers(turned(corners)), integers(counts), uv))
    mesh.getSchema().createFaceSet("hem")
    faces = mesh.getSchema().getFaceSet("hem").getSchema()
    sample = OFaceSetSchemaSample(integers(hem))
    faces.set(sample)
    del mesh, faces, archive


def colors():
    made = Usd.Stage.CreateNew("colors.usda")
    UsdGeom.SetStageMetersPerUnit(made, 0.001)
    UsdGeom.SetStageUpAxis(made, "Y")

    def two(path):
        curves = UsdGeom.BasisCurves.Define(made, path)
        curves.CreateTypeAttr("linear")
        curves.CreateCurveVertexCountsAttr([2, 2])
        y = len(list(made.Traverse()))
        curves.CreatePointsAttr([(0, y, 0), (3, y, 0), (0, y + 0.5, 0), (3, y + 0.5, 0)])
        curves.CreateWidthsAttr([0.4])
        curves.SetWidthsInterpolation("constant")
        return curves

    def color(curves, values, spread, indices=None):
        var = UsdGeom.PrimvarsAPI(curves).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, spread)
        var.Set(Vt.Vec3fArray([Gf.Vec3f(*v) for v in values]))
        if indices:
            var.SetIndices(Vt.IntArray(indices))

    red, blue, green = (0.8, 0.05, 0.05), (0.05, 0.1, 0.7), (0.1, 0.6, 0.1)
    color(two("/constant"), [red], "constant")
    uniform = two("/uniform")
    color(uniform, [red, blue], "uniform")
    ids = UsdGeom.PrimvarsAPI(uniform).CreatePrimvar("yarnId", Sdf.ValueTypeNames.IntArray, "uniform")
    ids.Set(Vt.IntArray([7, 9]))
    color(two("/indexed"), [blue, green], "uniform", [1, 0])
    color(two("/vertex"), [red, blue, green, green], "vertex")
    two("/none")
    made.GetRootLayer().Save()


usd()
abc()
colors()
