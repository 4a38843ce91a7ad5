"""Run fTetWild in a process of its own: `python tetwild_worker.py IN.npz OUT.npz`, started by `tet_meshing`.

fTetWild writes a file to the folder it runs in, ends the process when an internal check fails, and cannot be
interrupted. In a process of its own none of this reaches the caller. This file imports nothing of the package.
"""

import sys

import numpy as np


def main(source: str, target: str) -> None:
    """Read vertices, triangles, ideal edge (mm) and envelope (relative), write vertices and tets."""
    from pytetwild.pytetwild import tetrahedralize

    with np.load(source) as given:
        vertices, tets = tetrahedralize(
            given["vertices"],
            given["triangles"].astype(np.int32),
            edge_length_abs=float(given["ideal_edge"]),
            epsilon=float(given["envelope"]),
            quiet=True,
            loglevel=6,
        )
    np.savez(target, vertices=np.asarray(vertices, float), tets=np.asarray(tets, np.int64))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
