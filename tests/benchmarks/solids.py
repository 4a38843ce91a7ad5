"""What a solid costs, in CPU time, and what the usual ways cost on the same struts.

    python tests/benchmarks/solids.py scale [members ...]   ms per member of every step, on warped grids
    python tests/benchmarks/solids.py mesh [members]        the direct mesh alone, with its memory
    python tests/benchmarks/solids.py files [members]       ms and kB per member of every file format
    python tests/benchmarks/solids.py compare [side ...]    3 side^2 (side - 1) straight struts, by booleans as well

The comparison uses round struts and balls at their nodes. CadQuery and build123d fuse them in one call; OCCT's fillet
is asked for all edges of the fused solid; manifold3d unites 24-gons.
"""

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from michell_cad.cad import FORMATS, ExportOptions, export_solid, file_name, forecast_step
from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.shell import assemble_shell
from michell_cad.cad.solid import build_solid
from michell_cad.cad.step import export_step
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss
from tests.cad.layouts import grid_truss, sized

LARGEST_FILLET = 144
"""OCCT's fillet is tried up to so many struts."""

RADIUS = 1.0


def grid_of(members: int) -> SizedTruss:
    """A warped grid with about so many curved, filleted, tapered members."""
    k = max(2, round((members / 3) ** (1 / 3)))
    return sized(grid_truss((k, k, k + 1), warp=0.08), RADIUS, 0.3)


def peak_gb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def timed(work: Callable[[], object]) -> tuple[float, object]:
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def scale(members: int) -> list[float]:
    """Times in ms per member: build = prepare + plan + kernel; all = build_solid with mesh and checks."""
    from michell_cad.cad import kernel

    tight, knobs = grid_of(members), Knobs()
    n = len(tight.truss.members)
    clock, marks = time.process_time, [time.process_time()]
    prepared = prepare_truss(tight, knobs)
    marks.append(clock())
    plan = assemble_shell(prepared)
    marks.append(clock())
    kernel.make_solids(plan)
    marks.append(clock())
    build = marks[-1] - marks[0]
    mesh_truss(prepared)
    marks.append(clock())
    solid = build_solid(tight, knobs)
    marks.append(clock())
    checks = marks[-1] - marks[-2] - (marks[-2] - marks[0])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truss.step"
        export_step(solid, path)
        marks.append(clock())
        size = path.stat().st_size / 1e3 / n
    steps = [b - a for a, b in pairwise(marks)]
    return [n, *(1e3 * x / n for x in (*steps[:3], build, steps[3], checks, steps[4], steps[5])), size, peak_gb()]


def mesh_alone(members: int) -> None:
    prepared = prepare_truss(grid_of(members), Knobs())
    n = len(prepared.sized.truss.members)
    seconds, mesh = timed(lambda: mesh_truss(prepared))
    genus = mesh.bodies - mesh.euler_number // 2  # type: ignore[attr-defined]
    expected = n - len(prepared.sized.truss.nodes) + 1
    print(
        f"{n} members: {1e3 * seconds / n:.3f} ms each, {len(mesh.triangles) / n:.0f} triangles each, "  # type: ignore
        f"watertight {mesh.is_watertight}, genus {genus} of {expected}, peak {peak_gb():.2f} GB"  # type: ignore
    )


def files(members: int) -> None:
    """Every format, STEP in all its forms."""
    solid = build_solid(grid_of(members), Knobs())
    n = solid.report.members
    jobs = [(name, ExportOptions()) for name in FORMATS]
    jobs += [("step", ExportOptions(pcurves=True)), ("step", ExportOptions(step_form="assembly"))]
    jobs += [("brep", ExportOptions(brep_binary=True))]
    seconds, parts = timed(lambda: solid.assembly)
    print(f"{n} members; {len(parts)} parts of the assembly built and checked: {1e3 * seconds / n:.2f} ms each")  # type: ignore
    with tempfile.TemporaryDirectory() as folder:
        for name, options in jobs:
            path = Path(folder) / file_name("truss", name)
            seconds, _ = timed(lambda path=path, options=options: export_solid(solid, path, options))  # type: ignore[misc]
            size, note = path.stat().st_size, ""
            if name == "step":
                forecast = forecast_step(solid, options.step_form, options.pcurves)
                note = f"; {options.step_form}, pcurves {options.pcurves}, forecast {forecast / size - 1:+.1%}"
            print(f"  {name}: {1e3 * seconds / n:.2f} ms, {size / 1e3 / n:.2f} kB{note}", flush=True)
    print(f"  peak {peak_gb():.2f} GB")


def compare(side: int) -> None:
    """The same straight struts by every way."""
    truss = sized(grid_truss((side, side, side), warp=0.0), RADIUS)
    n = len(truss.truss.members)
    knobs = Knobs(fillet_ratio=0.0)
    from michell_cad.cad import kernel

    build_solid(sized(grid_truss((2, 2, 2), warp=0.0), RADIUS), knobs)  # loads the kernel
    build, _ = timed(lambda: kernel.make_solids(assemble_shell(prepare_truss(truss, knobs))))
    checked, solid = timed(lambda: build_solid(truss, knobs))
    report = solid.report  # type: ignore[attr-defined]
    print(f"{n} struts: direct shell {build:.2f} s, with checks {checked:.2f} s, {report.volume_mm3:.6g} mm^3")
    filleted, solid = timed(lambda: build_solid(truss, Knobs()))
    volume = solid.report.volume_mm3  # type: ignore[attr-defined]
    print(f"  direct shell with fillets and checks {filleted:.2f} s, {volume:.6g} mm^3")
    X, M = truss.truss.nodes, truss.truss.members
    R = 1.8 * RADIUS
    for name, work in (("CadQuery fuse", cadquery_fuse), ("build123d fuse", build123d_fuse), ("manifold3d", manifold)):
        seconds, (volume, valid, shape) = timed(lambda work=work: work(X, M, R))  # type: ignore[misc]
        print(
            f"  {name}: {seconds:.2f} s, {seconds / build:.0f} x the build, {seconds / checked:.0f} x with checks; "
            f"{volume:.6g} mm^3, valid {valid}"
        )
        if name == "CadQuery fuse" and n <= LARGEST_FILLET:
            seconds, outcome = timed(lambda shape=shape: try_fillet(shape))
            print(f"  OCCT fillet of all edges: {seconds:.2f} s, {outcome}")


def cadquery_fuse(X: np.ndarray, M: np.ndarray, R: float):
    import cadquery as cq

    struts = [
        cq.Solid.makeCylinder(RADIUS, float(np.linalg.norm(b - a)), cq.Vector(*a), cq.Vector(*(b - a))) for a, b in X[M]
    ]
    balls = [cq.Solid.makeSphere(R, cq.Vector(*x), cq.Vector(0, 0, 1), -90, 90, 360) for x in X]
    fused = struts[0].fuse(*struts[1:], *balls)
    return fused.Volume(), fused.isValid(), fused


def build123d_fuse(X: np.ndarray, M: np.ndarray, R: float):
    import build123d as b3

    struts = [
        b3.Solid.make_cylinder(RADIUS, float(np.linalg.norm(b - a)), b3.Plane(origin=tuple(a), z_dir=tuple(b - a)))
        for a, b in X[M]
    ]
    balls = [b3.Solid.make_sphere(R, b3.Plane(origin=tuple(x))) for x in X]
    fused = struts[0].fuse(*struts[1:], *balls)
    return fused.volume, fused.is_valid, fused


def manifold(X: np.ndarray, M: np.ndarray, R: float):
    import manifold3d

    parts = [manifold3d.Manifold.sphere(R, 24).translate(x) for x in X.tolist()]
    for a, b in X[M]:
        z = (b - a) / np.linalg.norm(b - a)
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        frame = np.stack([x, np.cross(z, x), z, a], axis=1)
        parts.append(manifold3d.Manifold.cylinder(float(np.linalg.norm(b - a)), RADIUS, RADIUS, 24).transform(frame))
    union = manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add)
    return union.volume(), union.status() == manifold3d.Error.NoError, union


def try_fillet(shape) -> str:
    try:
        result = shape.fillet(0.4 * RADIUS, shape.Edges())
    except Exception as error:  # noqa: BLE001 - the kernel's own exceptions have no common base
        return f"failed: {error}"
    return f"valid {result.isValid()}, {result.Volume():.6g} mm^3"


if __name__ == "__main__":
    mode, numbers = sys.argv[1] if len(sys.argv) > 1 else "scale", [int(x) for x in sys.argv[2:]]
    if mode == "compare":
        for side in numbers or [3, 4, 7]:
            compare(side)
    elif mode == "mesh":
        mesh_alone(*(numbers or [10000]))
    elif mode == "files":
        files(*(numbers or [10000]))
    else:
        columns = ("members", "prepare", "plan", "kernel", "build", "mesh", "checks", "all", "step", "kB", "peak GB")
        print("".join(f"{name:>9}" for name in columns))
        for wanted in numbers or [100, 1000, 3000]:
            print("".join(f"{x:9.3g}" for x in scale(wanted)), flush=True)
