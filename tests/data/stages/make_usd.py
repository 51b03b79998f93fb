"""Makes the USD files beside it with usd-core 26.11 (`pip install usd-core==26.11`): `python make_usd.py`."""

from pxr import Gf, Sdf, Usd, UsdGeom, Vt


def stage(name, unit=0.01, up="Y"):
    made = Usd.Stage.CreateNew(name)
    UsdGeom.SetStageMetersPerUnit(made, unit)
    UsdGeom.SetStageUpAxis(made, up)
    return made


def point(i):
    """Points that no basis maps onto each other."""
    return Gf.Vec3f(i, (i * i) % 5, (3 * i) % 4)


def matrix(extension):
    """Every basis, wrap and spread of widths; two curves a prim."""
    made = stage(f"matrix.{extension}")
    for basis in ["linear", "bezier", "bspline", "catmullRom"]:
        for wrap in ["nonperiodic", "periodic", "pinned"]:
            counts = [7, 4] if (basis, wrap) != ("bezier", "periodic") else [6, 3]
            for spread in ["constant", "uniform", "varying", "vertex"]:
                curves = UsdGeom.BasisCurves.Define(made, f"/{basis}_{wrap}_{spread}")
                curves.CreateTypeAttr("linear" if basis == "linear" else "cubic")
                if basis != "linear":
                    curves.CreateBasisAttr(basis)
                curves.CreateWrapAttr(wrap)
                curves.CreateCurveVertexCountsAttr(counts)
                curves.CreatePointsAttr([point(i) for i in range(sum(counts))])
                sizes = {
                    "constant": 1,
                    "uniform": len(counts),
                    "varying": curves.ComputeVaryingDataSize(Usd.TimeCode.Default())
                    if hasattr(curves, "ComputeVaryingDataSize")
                    else None,
                    "vertex": sum(counts),
                }
                if sizes["varying"] is None:
                    def segments(n):
                        if basis == "bezier":
                            return n // 3 if wrap == "periodic" else (n - 1) // 3
                        if wrap == "periodic":
                            return n
                        if basis == "linear" or wrap == "pinned":
                            return n - 1
                        return n - 3
                    sizes["varying"] = sum(segments(n) + (wrap != "periodic") for n in counts)
                curves.CreateWidthsAttr([0.2 + 0.1 * i for i in range(sizes[spread])])
                curves.SetWidthsInterpolation(spread)
    made.GetRootLayer().Save()


def two_points(made, path):
    curves = UsdGeom.BasisCurves.Define(made, path)
    curves.CreateTypeAttr("linear")
    curves.CreateCurveVertexCountsAttr([2])
    curves.CreatePointsAttr([(0, 0, 0), (1, 0, 0)])
    curves.CreateWidthsAttr([0.5])
    curves.SetWidthsInterpolation("constant")
    return curves


def scene():
    """Transforms, visibility, instances, instancers, materials, times and a camera; metres, z up."""
    made = stage("scene.usda", 1.0, "Z")
    made.SetStartTimeCode(1)
    made.SetEndTimeCode(10)
    top = UsdGeom.Xform.Define(made, "/top")
    top.AddTranslateOp().Set((10, 0, 0))
    arm = UsdGeom.Xform.Define(made, "/top/arm")
    pivot = arm.AddTranslateOp(opSuffix="pivot")
    pivot.Set((0, 1, 0))
    arm.AddRotateXYZOp().Set((0, 0, 90))
    arm.AddScaleOp().Set((2, 2, 2))
    arm.AddTranslateOp(opSuffix="pivot", isInverseOp=True)
    two_points(made, "/top/arm/curve")
    free = UsdGeom.Xform.Define(made, "/top/free")
    free.SetResetXformStack(True)
    free.AddTranslateOp().Set((0, 0, 5))
    two_points(made, "/top/free/curve")
    hidden = UsdGeom.Xform.Define(made, "/hidden")
    UsdGeom.Imageable(hidden).MakeInvisible()
    two_points(made, "/hidden/curve")
    guide = UsdGeom.Xform.Define(made, "/guide")
    UsdGeom.Imageable(guide).CreatePurposeAttr("guide")
    two_points(made, "/guide/curve")

    prototype = made.OverridePrim("/classes/loop")
    made.GetPrimAtPath("/classes").SetSpecifier(Sdf.SpecifierClass)
    UsdGeom.Xform.Define(made, "/classes/loop")
    two_points(made, "/classes/loop/curve")
    for i in range(2):
        instance = UsdGeom.Xform.Define(made, f"/instance{i}")
        instance.AddTranslateOp().Set((0, 20 + i, 0))
        instance.GetPrim().GetReferences().AddInternalReference("/classes/loop")
        instance.GetPrim().SetInstanceable(True)
    assert prototype

    instancer = UsdGeom.PointInstancer.Define(made, "/many")
    two_points(made, "/many/prototypes/a")
    instancer.CreatePrototypesRel().AddTarget("/many/prototypes/a")
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.CreatePositionsAttr([(0, 0, 0), (0, 30, 0), (0, 40, 0)])
    half = 0.5 ** 0.5
    instancer.CreateOrientationsAttr([Gf.Quath(1), Gf.Quath(half, 0, 0, half), Gf.Quath(1)])
    instancer.CreateScalesAttr([(1, 1, 1), (3, 3, 3), (1, 1, 1)])
    instancer.InvisibleIds = instancer.CreateInvisibleIdsAttr([2])

    moving = two_points(made, "/moving")
    moving.GetPointsAttr().Set([(0, 0, 0), (1, 0, 0)], 1)
    moving.GetPointsAttr().Set([(0, 0, 10), (1, 0, 10)], 10)

    dyed = two_points(made, "/dyed")
    material = made.DefinePrim("/looks/red_wool", "Material")
    dyed.GetPrim().CreateRelationship("material:binding", False).AddTarget(material.GetPath())

    camera = UsdGeom.Camera.Define(made, "/rig/camera")
    UsdGeom.Xform.Define(made, "/rig").AddTranslateOp().Set((0, 0, 3))
    turn = camera.AddRotateXOp()
    turn.Set(0, 1)
    turn.Set(90, 10)
    camera.CreateFocalLengthAttr(35)
    camera.CreateHorizontalApertureAttr(36)
    camera.CreateVerticalApertureAttr(24)
    camera.CreateFStopAttr(4)
    camera.CreateFocusDistanceAttr(2)
    made.GetRootLayer().Save()


def meshes():
    """A quad, a pentagon and a triangle in two subsets, texture coordinates of every spread; wound either way."""
    made = stage("mesh.usda")
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2.5, 0.5, 0), (2, 1, 0)]
    counts, corners = [4, 5, 3], [0, 1, 2, 3, 1, 4, 5, 6, 2, 3, 2, 6]

    def mesh(path, orientation="rightHanded"):
        out = UsdGeom.Mesh.Define(made, path)
        out.CreatePointsAttr(points)
        out.CreateFaceVertexCountsAttr(counts)
        out.CreateFaceVertexIndicesAttr(corners)
        out.CreateSubdivisionSchemeAttr("none")
        out.CreateOrientationAttr(orientation)
        return out

    def st(out, values, spread, indices=None):
        var = UsdGeom.PrimvarsAPI(out).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, spread)
        var.Set(Vt.Vec2fArray(values))
        if indices:
            var.SetIndices(Vt.IntArray(indices))

    panels = mesh("/panels")
    st(panels, [(i, 2 * i) for i in range(8)], "faceVarying", [0, 1, 2, 3, 1, 4, 5, 6, 2, 3, 7, 6])
    for name, faces in [("body", [0, 1]), ("collar", [2])]:
        subset = UsdGeom.Subset.Define(made, f"/panels/{name}")
        subset.CreateElementTypeAttr("face")
        subset.CreateFamilyNameAttr("panel")
        subset.CreateIndicesAttr(faces)
    st(mesh("/vertex"), [(i, i) for i in range(7)], "vertex")
    st(mesh("/flat"), [(c, 0) for c in corners], "faceVarying")
    mesh("/left", "leftHanded")
    moved = mesh("/mirrored")
    moved.AddScaleOp().Set((-1, 1, 1))
    made.GetRootLayer().Save()


matrix("usda")
matrix("usdc")
scene()
meshes()
from pxr import UsdUtils  # noqa: E402

UsdUtils.CreateNewUsdzPackage("matrix.usdc", "matrix.usdz")
