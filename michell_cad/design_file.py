"""The design file: everything that is needed to edit tomorrow without computing again, as one `.npz`.

Plain arrays and one JSON text, no pickled objects: the file can be read by any NumPy, and reading it runs no code.
"""

import json
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from michell_cad.curves import Curve, CurveKind, Curves
from michell_cad.edits import NO_EDITS, EditList, Structure
from michell_cad.elasticity import ElasticityOptions, StressField
from michell_cad.errors import InvalidInputError
from michell_cad.files import writing
from michell_cad.frame_field import FrameField, FrameFieldOptions
from michell_cad.isocurves import CurveNetwork
from michell_cad.knobs import Knobs
from michell_cad.metrics import Alignment
from michell_cad.parametrization import Parametrization, ParametrizationOptions
from michell_cad.pipeline import Design, DesignOptions, StageTime
from michell_cad.problem import DesignProblem, LoadCase, Material
from michell_cad.strength import StrengthenOptions
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import CleaningReport, Truss, TrussOptions

if TYPE_CHECKING:
    from michell_cad.cad import KeptSolid

DESIGN_FILE = "design.npz"
"""Its name in a folder of results."""

FORMAT = "michell_cad.design"
VERSION = 2
"""Version 2 has edits; a program that does not know them must not build the unedited truss instead."""

DEFAULT_UP = 2
"""The axis that points up in pictures of a design that does not say so: z."""


def save_design(
    path: str | Path,
    design: Design,
    knobs: Knobs,
    edits: EditList = NO_EDITS,
    up: int = DEFAULT_UP,
    kept: "Sequence[KeptSolid]" = (),
    sizing: StrengthenOptions | None = None,
) -> None:
    """Write a design, the knobs and edits it was built with, the solids to unite it with, and how to size it.

    The file appears under its name only when it is complete. It holds the whole truss: knobs and edits are replayed.
    `up` is the axis (0, 1, 2) that points up in pictures.
    """
    problem, mesh, truss, network = design.problem, design.problem.mesh, design.truss, design.network
    arrays = {
        "vertices": mesh.vertices,
        "tets": mesh.tets,
        "cad_faces": mesh.cad_faces,
        "fixed": problem.fixed,
        "forces": np.array([case.force for case in problem.load_cases]),
        "stress": design.stress_field.stress,
        "displacements": design.stress_field.displacements,
        "frames": design.frame_field.frames,
        "phi": design.parametrization.phi,
        "truss_nodes": truss.nodes,
        "truss_node_kinds": truss.node_kinds,
        "truss_members": truss.members,
        "truss_waypoints": truss.waypoints,
        "truss_waypoint_offsets": truss.waypoint_offsets,
        **_pack_curves("truss", truss.curves),
        "network_nodes": network.nodes,
        "network_node_kinds": network.node_kinds,
        "network_node_levels": network.node_levels,
        "network_members": network.members,
        "network_path_points": network.path_points,
        "network_path_offsets": network.path_offsets,
        **_pack_curves("network", network.curves),
        **_pack_kept(kept),
    }
    meta = {
        "format": FORMAT,
        "version": VERSION,
        "material": asdict(problem.material),
        "cases": [{"name": case.name, "weight": case.weight} for case in problem.load_cases],
        "combination": problem.combination,
        "options": asdict(design.options),
        "smoothing_steps": design.stress_field.smoothing_steps,
        "smoothing_residuals": design.stress_field.smoothing_residuals,
        "solver_unit": design.stress_field.solver_unit,
        "data_energy": design.frame_field.data_energy,
        "least_data_energy": design.frame_field.least_data_energy,
        "start_energies": design.frame_field.start_energies,
        "spacing": truss.spacing,
        "truss_curves": _curve_labels(truss.curves),
        "network_curves": _curve_labels(network.curves),
        "cleaning": asdict(design.cleaning),
        "alignment": asdict(design.alignment),
        "times": [asdict(time) for time in design.times],
        "knobs": knobs.model_dump(mode="json"),
        "edits": edits.located(),
        "kept": [one.name for one in kept],
        "sizing": None if sizing is None else asdict(sizing),
        "up": up,
    }
    with writing(Path(path)) as partial, partial.open("wb") as file:
        np.savez_compressed(file, meta=np.array(json.dumps(meta)), **arrays)


@dataclass(frozen=True, eq=False)
class Saved:
    """What a design file holds: a design, the knobs and edits it was built with, what it keeps, how it is sized."""

    design: Design
    knobs: Knobs
    edits: EditList
    kept: "tuple[KeptSolid, ...]"
    sizing: StrengthenOptions | None
    up: int

    def replay(self, knobs: Knobs | None = None, edits: EditList | None = None) -> Structure:
        """The structure, by other knobs and edits if some are given."""
        structure = (self.edits if edits is None else edits).replay(self.design, knobs or self.knobs)
        return replace(structure, kept=self.kept, sizing=self.sizing)


def load_saved(path: str | Path) -> Saved:
    """Read all of a design file; errors as for `load_design`."""
    arrays, meta = _read(Path(path))
    sizing = meta.get("sizing")
    return Saved(
        *_rebuild(arrays, meta),
        EditList.of(meta.get("edits", []), str(path)),
        _unpack_kept(arrays, meta),
        None if sizing is None else StrengthenOptions(**sizing),
        int(meta.get("up", DEFAULT_UP)),
    )


def load_design(path: str | Path) -> tuple[Design, Knobs]:
    """Read a design file back: the design, with nothing computed again, and its knobs.

    Raises
    ------
    InvalidInputError
        If the file is missing, cut short, no design file, or written by a newer version.
    """
    return _rebuild(*_read(Path(path)))


def load_edits(path: str | Path) -> EditList:
    """Read the edits of a design file; errors as for `load_design`."""
    return EditList.of(_read(Path(path), only_meta=True)[1].get("edits", []), str(path))


def open_structure(path: str | Path) -> Structure:
    """Read a design file and replay its knobs and edits on the truss; errors as for both."""
    return load_saved(path).replay()


_KEPT = ("solids", "clearance")


def _pack_kept(kept: "Sequence[KeptSolid]") -> dict[str, np.ndarray]:
    """The kernel's shapes as bytes of its own binary format."""
    if not kept:
        return {}
    from michell_cad.cad.kernel_files import solids_to_bytes

    return {
        f"kept_{k}_{what}": np.frombuffer(solids_to_bytes(getattr(one, what)), np.uint8)
        for k, one in enumerate(kept)
        for what in _KEPT
    }


def _unpack_kept(arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> "tuple[KeptSolid, ...]":
    if not meta.get("kept"):
        return ()
    from michell_cad.cad.keep import KeptSolid
    from michell_cad.cad.kernel_files import solids_from_bytes

    return tuple(
        KeptSolid(name, *(solids_from_bytes(arrays[f"kept_{k}_{what}"].tobytes()) for what in _KEPT))
        for k, name in enumerate(meta["kept"])
    )


def _read(path: Path, only_meta: bool = False) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    path = path / DESIGN_FILE if path.is_dir() else path
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            meta = json.loads(str(file["meta"]))
            arrays = {} if only_meta else {name: file[name] for name in file.files if name != "meta"}
    except FileNotFoundError:
        raise InvalidInputError(f"no design file {path}: expected the design.npz that `design` writes") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        reason = f": {error.strerror}" if isinstance(error, OSError) and error.strerror else ""
        raise InvalidInputError(
            f"{path} is not a complete design file{reason}: it was cut short, or is something else; run `design` again"
        ) from error
    if meta.get("format") != FORMAT:
        raise InvalidInputError(f"{path} is not a design file: its format is {meta.get('format')!r}, not {FORMAT!r}")
    if meta["version"] > VERSION:
        raise InvalidInputError(
            f"{path} has version {meta['version']}, this program reads up to {VERSION}: install a newer michell_cad"
        )
    return arrays, meta


def _rebuild(a: dict[str, np.ndarray], meta: dict[str, Any]) -> tuple[Design, Knobs]:
    mesh = TetMesh(a["vertices"], a["tets"], a["cad_faces"])
    cases = tuple(
        LoadCase(case["name"], force, case["weight"]) for case, force in zip(meta["cases"], a["forces"], strict=True)
    )
    problem = DesignProblem(mesh, Material(**meta["material"]), a["fixed"], cases, meta["combination"])
    options = meta["options"]

    def tuples(values: dict[str, Any]) -> dict[str, Any]:  # JSON knows lists only
        return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}

    return Design(
        problem,
        DesignOptions(
            options["resolution"],
            options["spacing"],
            options.get("layers", "clear"),  # files from before there was a choice
            ElasticityOptions(**options["elasticity"]),
            FrameFieldOptions(**tuples(options["frames"])),
            ParametrizationOptions(**tuples(options["parametrization"])),
            TrussOptions(**options["truss"]),
        ),
        StressField(
            a["stress"],
            a["displacements"],
            tuple(meta["smoothing_steps"]),
            tuple(meta["smoothing_residuals"]),
            meta["solver_unit"],
        ),
        FrameField(a["frames"], meta["data_energy"], meta["least_data_energy"], tuple(meta["start_energies"])),
        Parametrization(mesh, a["phi"]),
        Truss(
            a["truss_nodes"],
            a["truss_node_kinds"],
            a["truss_members"],
            _unpack_curves("truss", a, meta["truss_curves"]),
            meta["spacing"],
            a["truss_waypoints"],
            a["truss_waypoint_offsets"],
        ),
        CurveNetwork(
            a["network_nodes"],
            a["network_node_kinds"],
            a["network_node_levels"],
            a["network_members"],
            a["network_path_points"],
            a["network_path_offsets"],
            Curves.of(_unpack_curves("network", a, meta["network_curves"])),
        ),
        CleaningReport(**tuples(meta["cleaning"])),
        Alignment(**tuples(meta["alignment"])),
        tuple(StageTime(**time) for time in meta["times"]),
    ), Knobs.model_validate(meta["knobs"])


def _pack_curves(prefix: str, curves: Sequence[Curve]) -> dict[str, np.ndarray]:
    def joined(parts: list[np.ndarray]) -> np.ndarray:
        return np.concatenate([np.zeros(0, np.int64), *parts])

    return {
        f"{prefix}_curve_nodes": joined([curve.nodes for curve in curves]),
        f"{prefix}_curve_members": joined([curve.members for curve in curves]),
        f"{prefix}_curve_lengths": np.array([(len(c.nodes), len(c.members)) for c in curves]).reshape(-1, 2),
    }


def _curve_labels(curves: Sequence[Curve]) -> list[list[Any]]:
    return [[str(c.kind), c.family, c.axis, list(c.isovalues), c.component, c.closed] for c in curves]


def _unpack_curves(prefix: str, a: dict[str, np.ndarray], labels: list[list[Any]]) -> tuple[Curve, ...]:
    lengths = np.cumsum(a[f"{prefix}_curve_lengths"], axis=0)[:-1]
    nodes = np.split(a[f"{prefix}_curve_nodes"], lengths[:, 0])
    members = np.split(a[f"{prefix}_curve_members"], lengths[:, 1])
    return tuple(
        Curve(CurveKind(kind), family, axis, tuple(isovalues), component, n, m, closed)
        for (kind, family, axis, isovalues, component, closed), n, m in zip(labels, nodes, members, strict=True)
    )
