"""The nodes of a truss as solids of their own: spheres with all fillets, closed by a plane disc at every tube.

Their faces are those of the one solid. Where that goes on with a tube, a node has a disc, along the same edges.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Int

from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell import assemble_shell
from michell_cad.cad.shell_plan import Coedges, Edges, FaceRole, Faces, PcurveForm, ShellPlan, SurfaceForm


def plan_nodes(prepared: PreparedTruss) -> tuple[ShellPlan, Int[np.ndarray, " n_b"]]:
    """The nodes as a plan with one component each, and the number of the node of each."""
    plan, n_e = assemble_shell(prepared), len(prepared.node_of_end)
    faces, coedges = plan.faces, plan.coedges
    is_tube = faces.role == FaceRole.MEMBER
    owner = faces.owner
    at_end = (faces.role == FaceRole.FILLET) | (faces.role == FaceRole.MITRE)
    node = np.where(at_end, prepared.node_of_end[np.where(at_end, owner, 0)], np.where(is_tube, 0, owner))
    kept = np.flatnonzero(~is_tube)
    nodes, body = np.unique(np.r_[node[kept], prepared.node_of_end], return_inverse=True)
    new = np.full(len(owner), -1)
    new[kept] = np.arange(len(kept))
    along_tube = is_tube[coedges.face]
    own = np.flatnonzero(~along_tube)
    # A tube's own seam has the tube on both sides.
    shared = np.isin(coedges.edge, coedges.edge[own])
    ring = np.flatnonzero(along_tube & shared)
    disc = len(kept) + _end_of_ring(prepared, plan, ring)
    rows = np.r_[own, ring]
    new_face = np.r_[new[coedges.face[own]], disc]
    order = np.argsort(new_face, kind="stable")
    rows = rows[order]
    used, edge = np.unique(coedges.edge[rows], return_inverse=True)
    on_disc = new_face[order] >= len(kept)
    form, wire = np.where(on_disc, PcurveForm.PLANAR, coedges.form[rows]), np.where(on_disc, 0, coedges.wire[rows])
    e = plan.edges
    planes = np.full(n_e, SurfaceForm.PLANE)
    # The frames of the tubes' circles come first in a plan, one for each end.
    everything = Faces(
        form=np.r_[faces.form[kept], planes],
        surface=np.r_[faces.surface[kept], np.arange(n_e)],
        reversed_=np.r_[faces.reversed_[kept], np.zeros(n_e, bool)],
        role=np.r_[faces.role[kept], np.full(n_e, FaceRole.NODE)],
        owner=np.r_[owner[kept], prepared.node_of_end],
        component=body,
    )
    return replace(
        plan,
        edges=Edges(e.form[used], e.curve[used], e.ranges[used], e.ends[used], e.tolerance[used]),
        faces=everything,
        coedges=Coedges(new_face[order], wire, edge, coedges.reversed_[rows], form, coedges.pcurve[rows]),
        tube_poles=(),
        components=len(nodes),
    ), nodes


def _end_of_ring(p: PreparedTruss, plan: ShellPlan, rows: np.ndarray) -> np.ndarray:
    """The end of the tube at which its coedges lie: the nearer one."""
    c = plan.coedges
    member = plan.faces.owner[c.face[rows]]
    X = p.sized.truss.nodes[p.node_of_end]
    center = (X + p.sizes.reach[:, None] * p.directions).reshape(-1, 2, 3)[member]
    point = plan.points[plan.edges.ends[c.edge[rows], 0]]
    return 2 * member + np.linalg.norm(center - point[:, None], axis=2).argmin(1)
