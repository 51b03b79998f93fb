"""Makes scene.abc beside it with alembic3d 1.8.12.1 (`pip install alembic3d==1.8.12.1`): `python make_abc.py`."""

import imath
from abc_arrays import floats, indices, integers, pairs, points
from alembic3d.Abc import *  # noqa: F403
from alembic3d.AbcCoreAbstract import TimeSampling
from alembic3d.AbcGeom import *  # noqa: F403


def point(i):
    return (i, (i * i) % 5, (3 * i) % 4)


def widths(values, scope):
    return OFloatGeomParamSample(floats(values), scope)


archive = OArchive("scene.abc")
top = archive.getTop()
frames = archive.addTimeSampling(TimeSampling(1.0 / 24.0, 0.0))

place = OXform(top, "place", frames)
for frame in range(3):
    sample = XformSample()
    sample.addOp(XformOp(XformOperationType.kTranslateOperation, 0), imath.V3d(10.0 * frame, 0, 0))
    sample.addOp(XformOp(XformOperationType.kRotateZOperation, 0), 90.0)
    sample.addOp(XformOp(XformOperationType.kScaleOperation, 0), imath.V3d(2, 2, 2))
    place.getSchema().set(sample)

kinds = [
    ("linear_open", CurveType.kLinear, CurvePeriodicity.kNonPeriodic, BasisType.kNoBasis),
    ("bspline_open", CurveType.kCubic, CurvePeriodicity.kNonPeriodic, BasisType.kBsplineBasis),
    ("bspline_closed", CurveType.kCubic, CurvePeriodicity.kPeriodic, BasisType.kBsplineBasis),
    ("catmull_open", CurveType.kCubic, CurvePeriodicity.kNonPeriodic, BasisType.kCatmullromBasis),
]
for name, kind, wrap, basis in kinds:
    curves = OCurves(place, name)
    width = widths([0.2 + 0.1 * i for i in range(9)], GeometryScope.kVertexScope)
    sample = OCurvesSchemaSample(
        points([point(i) for i in range(9)]), integers([5, 4]), kind, wrap, width, OV2fGeomParamSample(),
        ON3fGeomParamSample(), basis)
    curves.getSchema().set(sample)

moving = OCurves(top, "moving", frames)
for frame in range(3):
    sample = OCurvesSchemaSample(
        points([(0, 0, frame), (1, 0, frame)]), integers([2]), CurveType.kLinear, CurvePeriodicity.kNonPeriodic,
        widths([0.5], GeometryScope.kConstantScope))
    moving.getSchema().set(sample)

hidden = OCurves(top, "hidden")
hidden.getSchema().set(OCurvesSchemaSample(
    points([(0, 0, 0), (1, 0, 0)]), integers([2]), CurveType.kLinear, CurvePeriodicity.kNonPeriodic))
CreateVisibilityProperty(hidden, 0).setValue(0)

mesh = OPolyMesh(top, "panels")
uv = OV2fGeomParamSample(
    pairs([(0, 0), (1, 0), (1, 1), (0, 1)]), indices([0, 1, 2, 3, 1, 0, 2]), GeometryScope.kFacevaryingScope)
mesh.getSchema().set(OPolyMeshSchemaSample(
    points([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0)]),
    integers([0, 1, 2, 3, 1, 4, 2]), integers([4, 3]), uv))
collar = mesh.getSchema().createFaceSet("collar")
faces = OFaceSetSchemaSample(integers([1]))
collar.getSchema().set(faces)
del mesh, collar, hidden, moving, curves, place, top, archive
