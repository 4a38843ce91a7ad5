"""Triangles of sharp mitres (nodes without fillets)."""

import numpy as np

from michell_cad.cad.mesh_blocks import TURN, Outline, mitre_area, zip_rings
from michell_cad.cad.mitre_cuts import SPHERE
from michell_cad.cad.shell_plan import FaceRole


def add_mitre(mesh, p, i: int, tube_ring, angles, around) -> Outline:
    """Cylinders of the mitred ends of node i; returns where they meet the sphere."""
    node, X = p.mitres[i], p.sized.truss.nodes[i]
    mitre, ends = node.mitre, node.ends
    corners = mesh.add_points(X + mitre.corners)
    used: dict[int, np.ndarray] = {}
    lines: dict[tuple, np.ndarray] = {}
    step = TURN / len(angles)
    on_sphere: dict[int, np.ndarray] = {}
    arcs: list[np.ndarray] = []
    for k, e in enumerate(ends):
        r, d, N = p.sizes.end_radius[e], p.directions[e], p.normals[e]
        B, H = np.cross(d, N), p.sizes.radius[i] * np.cos(p.caps[e])
        path_u, path_v = [], []
        for piece in mitre.pieces[k]:
            n = max(1, int(np.ceil((piece.stop - piece.start) / step - 1e-9)))
            u = piece.start + (piece.stop - piece.start) * np.arange(n) / n
            key = (min(k, piece.neighbour), max(k, piece.neighbour), *sorted((piece.first, piece.last)))
            if piece.neighbour == SPHERE:
                key = (k, SPHERE, piece.first, piece.last)
            if key not in lines:
                inner = u[1:]
                height = np.full(len(inner), H)
                if piece.neighbour != SPHERE:
                    across = d - p.directions[ends[piece.neighbour]]
                    arm = np.cos(inner)[:, None] * N + np.sin(inner)[:, None] * B
                    height = -r * (arm @ across) / (d @ across)
                arm = np.cos(inner)[:, None] * N + np.sin(inner)[:, None] * B
                points = height[:, None] * d + r * arm
                line = mesh.add_points(X + points)
                used.update(zip(line.tolist(), points, strict=True))
                lines[key] = line
                inner_line = line
            else:
                inner_line = lines[key][::-1]
            path_u.append(u)
            path_v.append(np.concatenate([[corners[piece.first]], inner_line]))
            if piece.neighbour == SPHERE:
                for c in (piece.first, piece.last):
                    on_sphere[int(corners[c])] = mitre.corners[c]
                on_sphere.update((int(v), used[int(v)]) for v in inner_line)
                chain = np.concatenate([[corners[piece.first]], inner_line, [corners[piece.last]]])
                arcs.append(np.stack([chain[:-1], chain[1:]], axis=1))
        bottom_u, bottom = np.concatenate(path_u), np.concatenate(path_v)
        mesh.add_triangles(zip_rings(bottom_u, bottom, angles, tube_ring[e]), FaceRole.MITRE, int(e))
    vertices = np.array(list(on_sphere), int)
    points = np.array(list(on_sphere.values())).reshape(-1, 3)
    area, loops = mitre_area(p, i)
    return Outline(vertices, points, np.concatenate([np.zeros((0, 2), int), *arcs]), area, loops)
