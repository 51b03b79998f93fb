#!/usr/bin/env python3
"""Holds USD files that yarnray wrote against usd-core: `tools/check_usd.py cloth.usda garment.usdc ...`.

Needs usd-core (`pip install usd-core`; written with 26.11). Checks metadata of the stage, the schema of every prim, the
number of points and of primvar values, extents, and runs USD's own validators. Prints what is wrong; exit status 1 if
anything is.
"""

import sys

from pxr import Gf, Tf, Usd, UsdGeom


def curves_problems(curves):
    """What is wrong with one BasisCurves prim."""
    prim = curves.GetPrim()
    counts = curves.GetCurveVertexCountsAttr().Get() or []
    points = curves.GetPointsAttr().Get() or []
    if sum(counts) != len(points):
        yield f"counts add up to {sum(counts)}, there are {len(points)} points"
    if not counts:
        yield "there are no curves"
        return
    for name, known in [("type", ["linear", "cubic"]), ("basis", ["bezier", "bspline", "catmullRom"]),
                        ("wrap", ["nonperiodic", "periodic", "pinned"])]:
        if prim.GetAttribute(name).Get() not in known:
            yield f"`{name}` is {prim.GetAttribute(name).Get()}"
    now = Usd.TimeCode.Default()
    widths = curves.GetWidthsAttr().Get() or []
    if not widths:
        yield "there are no widths"
    elif min(widths) <= 0:
        yield f"a width is {min(widths)}"
    sizes = {
        "constant": 1,
        "uniform": curves.ComputeUniformDataSize(now),
        "varying": curves.ComputeVaryingDataSize(now),
        "vertex": curves.ComputeVertexDataSize(now),
    }
    spread = curves.GetWidthsInterpolation()
    if len(widths) != sizes.get(spread):
        yield f"{spread} widths are {sizes.get(spread)} for usd-core, found {len(widths)}"
    for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithAuthoredValues():
        values = primvar.ComputeFlattened()
        expected = sizes.get(primvar.GetInterpolation())
        if values is None or len(values) != expected:
            yield f"{primvar.GetName()}: {primvar.GetInterpolation()} values are {expected}, found {values and len(values)}"
    extent = curves.GetExtentAttr().Get()
    computed = UsdGeom.Boundable.ComputeExtentFromPlugins(curves, now)
    if not extent:
        yield "there is no extent"
    elif computed:
        slack = 1e-5 * (Gf.Range3f(*computed).GetSize().GetLength())
        low, high = [Gf.Vec3f(p) for p in extent]
        if any(low[i] > computed[0][i] + slack or high[i] < computed[1][i] - slack for i in range(3)):
            yield f"the extent {list(extent)} does not hold usd-core's {list(computed)}"
    known = set(prim.GetPrimDefinition().GetPropertyNames())
    for attribute in prim.GetAuthoredAttributes():
        name = attribute.GetName()
        if name not in known and not name.startswith("primvars:"):
            yield f"`{name}` is no property of {prim.GetTypeName()}"
        elif name in known:
            wanted = prim.GetPrimDefinition().GetSchemaAttributeSpec(name)
            if wanted and wanted.typeName != attribute.GetTypeName():
                yield f"`{name}` is {attribute.GetTypeName()}, the schema has {wanted.typeName}"
            if wanted and wanted.variability != attribute.GetVariability():
                yield f"`{name}` has another variability than the schema"


def validators_problems(stage):
    """What USD's own validation says, in versions that have it."""
    try:
        from pxr import UsdValidation
    except ImportError:
        return
    registry = UsdValidation.ValidationRegistry()
    names = [m.name for m in registry.GetAllValidatorMetadata() if not m.isSuite]
    context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(names))
    for error in context.Validate(stage):
        yield f"{error.GetName()}: {error.GetMessage()}"


def file_problems(path):
    """What is wrong with a file, and its numbers of prims and curves."""
    stage = Usd.Stage.Open(path)
    problems, prims, total = [], 0, 0
    if not stage.GetDefaultPrim():
        problems.append("there is no default prim")
    for key in ["metersPerUnit", "upAxis"]:
        if not stage.HasAuthoredMetadata(key):
            problems.append(f"`{key}` is not authored")
    for prim in stage.Traverse():
        if not prim.GetTypeName() or not prim.GetPrimDefinition():
            problems.append(f"{prim.GetPath()}: no such schema: {prim.GetTypeName()}")
        if prim.IsA(UsdGeom.BasisCurves):
            curves = UsdGeom.BasisCurves(prim)
            prims, total = prims + 1, total + len(curves.GetCurveVertexCountsAttr().Get() or [])
            problems += [f"{prim.GetPath()}: {problem}" for problem in curves_problems(curves)]
    problems += list(validators_problems(stage))
    return problems, prims, total


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    bad = False
    for path in sys.argv[1:]:
        try:
            problems, prims, total = file_problems(path)
        except Tf.ErrorException as error:
            problems, prims, total = [str(error)], 0, 0
        bad |= bool(problems)
        print(f"{path}: {prims} prims, {total} curves, {len(problems)} problems")
        for problem in problems:
            print(f"  {problem}")
    sys.exit(bad)


main()
