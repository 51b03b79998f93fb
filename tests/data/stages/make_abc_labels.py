"""Makes labels.abc beside it with alembic3d 1.8.12.1 (`pip install alembic3d==1.8.12.1`): `python make_abc_labels.py`.

Curves with colours and numbers under the names that programs give them, of every scope, plain and by indices.
"""

from abc_arrays import colors, indices, integers, points
from alembic3d.Abc import *  # noqa: F403
from alembic3d.AbcGeom import *  # noqa: F403

RED, GREEN, BLUE = (0.8, 0.05, 0.05), (0.1, 0.6, 0.1), (0.05, 0.1, 0.8)

archive = OArchive("labels.abc")
top = archive.getTop()


def curves(name):
    """Two linear curves, of three points and of two."""
    own = OCurves(top, name)
    own.getSchema().set(OCurvesSchemaSample(
        points([(i, 0, 0) for i in range(5)]), integers([3, 2]), CurveType.kLinear, CurvePeriodicity.kNonPeriodic))
    return own, own.getSchema().getArbGeomParams()


kept = []


def colored(name, parameter, scope, values, by=None):
    own, more = curves(name)
    param = OC3fGeomParam(more, parameter, by is not None, scope, 1)
    sample = OC3fGeomParamSample(colors(values), scope) if by is None else OC3fGeomParamSample(
        colors(values), indices(by), scope)
    param.set(sample)
    kept.extend([own, param])
    return more


colored("constant", "displayColor", GeometryScope.kConstantScope, [RED])
more = colored("uniform", "Cs", GeometryScope.kUniformScope, [RED, BLUE])
for parameter, values in [("yarnId", [7, 9]), ("plyId", [0, 1])]:
    number = OInt32GeomParam(more, parameter, False, GeometryScope.kUniformScope, 1)
    number.set(OInt32GeomParamSample(integers(values), GeometryScope.kUniformScope))
    kept.append(number)
colored("vertex", "Cd", GeometryScope.kVertexScope, [RED, RED, RED, BLUE, GREEN])
colored("indexed", "rgb", GeometryScope.kUniformScope, [GREEN, BLUE], [1, 0])
colored("wrong", "Cs", GeometryScope.kUniformScope, [RED, GREEN, BLUE])
more = curves("text")[1]
text = OStringArrayProperty(more, "Cs")
kept.append(text)
del text, more, kept, top, archive
