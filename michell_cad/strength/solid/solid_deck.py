"""Input deck of a solid for CalculiX and programs that read Abaqus' format: quadratic tets C3D10, one step a case.

Units: mm, N, MPa. Nodes and elements count from 1 in the order of the mesh.
"""

from pathlib import Path

import numpy as np

from michell_cad.files import writing
from michell_cad.problem import Material
from michell_cad.strength.solid.quadratic_mesh import QuadraticMesh
from michell_cad.strength.solid.solid_loading import SolidLoading


def write_solid_deck(path: str | Path, mesh: QuadraticMesh, material: Material, loading: SolidLoading) -> None:
    """Write a solid with its supports and load cases; the file is there whole or not at all."""
    n_p, n_t = len(mesh.nodes), len(mesh.tets)
    nodes = np.column_stack([np.arange(1, n_p + 1), mesh.nodes])
    tets = np.column_stack([np.arange(1, n_t + 1), mesh.tets + 1])
    held = np.argwhere(loading.fixed)
    with writing(Path(path)) as partial, partial.open("w", encoding="utf-8") as file:
        file.write("** solid of a truss; mm, N, MPa\n*NODE, NSET=NALL\n")
        np.savetxt(file, nodes, fmt=["%d", *["%.12g"] * 3], delimiter=", ")
        file.write("*ELEMENT, TYPE=C3D10, ELSET=EALL\n")
        np.savetxt(file, tets, fmt="%d", delimiter=", ")
        file.write(f"*MATERIAL, NAME=TRUSS\n*ELASTIC\n{material.youngs_modulus:.12g}, {material.poisson_ratio:.12g}\n")
        file.write("*SOLID SECTION, ELSET=EALL, MATERIAL=TRUSS\n*BOUNDARY\n")
        np.savetxt(file, np.column_stack([held[:, 0] + 1, held[:, 1] + 1, held[:, 1] + 1]), fmt="%d", delimiter=", ")
        for name, forces in zip(loading.names, loading.forces, strict=True):
            file.write(f"** load case {name}\n*STEP\n*STATIC\n*CLOAD, OP=NEW\n")
            node, axis = np.nonzero((forces != 0) & ~loading.fixed)
            acting = np.column_stack([node + 1, axis + 1, forces[node, axis]])
            np.savetxt(file, acting, fmt=["%d", "%d", "%.12g"], delimiter=", ")
            file.write("*NODE FILE\nU\n*EL FILE\nS\n*NODE PRINT, NSET=NALL\nU\n*END STEP\n")
