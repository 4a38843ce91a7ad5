"""Show a finished design in the CadQuery editor, in the colours of its families; the constants below are its knobs.

Also runs through `cadquery.cqgi`, where the constants are the parameters, each with the text of `michell-cad knobs`.
"""

from michell_cad.scripting.finished import open_finished

design_file = "bracket-truss/design.npz"  # as `michell-cad design` wrote it
family = "all"
radius = 0.0  # 0: not set
volume_fraction = 0.0  # 0: not set
mass = 0.0  # 0: not set
smallest_radius = 0.0
entasis = 0.0
every = 1
offset = 0
node_ratio = 1.8
fillet_ratio = 0.4
profile = "round"
profile_aspect = 1.0
node_form = "sphere"

knobs = {
    "family": family,
    "radius": radius or None,
    "volume_fraction": volume_fraction or None,
    "mass": mass or None,
    "smallest_radius": smallest_radius,
    "entasis": entasis,
    "every": every,
    "offset": offset,
    "node_ratio": node_ratio,
    "fillet_ratio": fillet_ratio,
    "profile": profile,
    "profile_aspect": profile_aspect,
    "node_form": node_form,
}
show_object(open_finished(design_file, knobs).solid.cadquery_assembly, name="truss")

if False:  # only to be read: CadQuery 2.8 takes these texts from the script and fails if it runs the line
    describe_parameter(
        family,
        "Families of curves to build; boundary curves go with their family, sharp edges stay. "
        "[all, tension, compression, third]",
    )
    describe_parameter(radius, "Radius of the members; default: 0.08 of the cell edge. [mm; above 0]")
    describe_parameter(
        volume_fraction, "Instead of a radius: volume of the truss over volume of the part. [above 0 below 1]"
    )
    describe_parameter(mass, "Instead of a radius: mass of the truss. [g; above 0]")
    describe_parameter(
        smallest_radius,
        "No member is thinner than this, whatever else says so: what the printer can make. [mm; from 0]",
    )
    describe_parameter(entasis, "Members are thicker by this fraction in the middle of each curve. [from -0.5 to 2]")
    describe_parameter(
        every,
        "Density: keep every n-th curve; one number, or one each for tension, compression and third. [from 1 to 1000]",
    )
    describe_parameter(
        offset, "Which of the n curves to keep: those whose isovalue plus offset is a multiple of n. [from 0 to 1000]"
    )
    describe_parameter(
        node_ratio, "Smallest radius of a node over the radius of its members; tight nodes take more. [from 1.2 to 4]"
    )
    describe_parameter(
        fillet_ratio,
        "Radius of the fillet between node and member over the radius of the member; 0: no fillets. [from 0 to 1]",
    )
    describe_parameter(
        profile,
        "Cross-section of the members, of the area of the circle of the radius; or the points (x, y) of an outline of "
        "one's own, as read from a .dxf, .svg, .step or .brep file if the name of one is given. "
        "[round, triangle, square, hexagon, octagon]",
    )
    describe_parameter(
        profile_aspect,
        "Stretches the profile along its x axis, which points along the curves of the next family: a square of 2 is a "
        "rectangle twice as long as wide. The area stays. [from 0.1 to 10]",
    )
    describe_parameter(
        node_form,
        "Nodes as spheres, or as convex hulls of the profiles that meet; hulls have no fillets, like all nodes of "
        "profiles that are not round. [sphere, hull]",
    )
