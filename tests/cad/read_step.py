"""Read a STEP file as another program does, and print its names, colours, layers and volumes as JSON.

    python tests/cad/read_step.py FILE

Each entry of `parts` is a solid with the names of its assemblies, each entry of `faces` a face that has a name or a
colour of its own. Colours are sRGB in 8 bits.
"""

import json
import sys

from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.STEPCAFControl import STEPCAFControl_Controller, STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TColStd import TColStd_HSequenceOfExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label, TDF_LabelSequence
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool


def name_of(label):
    attribute = TDataStd_Name()
    found = label.IsAttribute(TDataStd_Name.GetID_s()) and label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
    return attribute.Get().ToExtString() if found else ""


def colour_of(colours, label):
    for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
        colour = Quantity_Color()
        if colours.GetColor_s(label, kind, colour):
            return [round(255 * value) for value in colour.Values(Quantity_TOC_sRGB)]
    return None


def layers_of(layers, label):
    names = TColStd_HSequenceOfExtendedString()
    layers.GetLayers(label, names)
    return [names.Value(i + 1).ToExtString() for i in range(names.Length())]


def describe_solid(label, path, tools):
    shapes, colours, layers = tools
    shape = shapes.GetShape_s(label)
    explorer, solids = TopExp_Explorer(shape, TopAbs_SOLID), 0
    while explorer.More():
        solids += 1
        explorer.Next()
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-6)
    return {
        "path": path,
        "name": name_of(label),
        "solids": solids,
        "valid": BRepCheck_Analyzer(shape).IsValid(),
        "volume": properties.Mass(),
        "colour": colour_of(colours, label),
        "layers": layers_of(layers, label),
    }


def walk(label, path, tools, found):
    shapes, colours, layers = tools
    if XCAFDoc_ShapeTool.IsAssembly_s(label):
        children = TDF_LabelSequence()
        shapes.GetComponents_s(label, children)
        for i in range(children.Length()):
            target = TDF_Label()
            shapes.GetReferredShape_s(children.Value(i + 1), target)
            walk(target, [*path, name_of(label)], tools, found)
        return
    found["parts"].append(describe_solid(label, path, tools))
    parts = TDF_LabelSequence()
    shapes.GetSubShapes_s(label, parts)
    for i in range(parts.Length()):
        face = parts.Value(i + 1)
        found["faces"].append([name_of(face), colour_of(colours, face), layers_of(layers, face)])


def read(path):
    STEPCAFControl_Controller.Init_s()
    Interface_Static.SetIVal_s("read.stepcaf.subshapes.name", 1)
    document = TDocStd_Document(TCollection_ExtendedString("MDTV-XCAF"))
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    reader.SetLayerMode(True)
    reader.ReadFile(path)
    reader.Transfer(document)
    main = document.Main()
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
    tools = (shapes, XCAFDoc_DocumentTool.ColorTool_s(main), XCAFDoc_DocumentTool.LayerTool_s(main))
    found = {"parts": [], "faces": []}
    free = TDF_LabelSequence()
    shapes.GetFreeShapes(free)
    for i in range(free.Length()):
        walk(free.Value(i + 1), [], tools, found)
    return found


if __name__ == "__main__":
    result = read(sys.argv[1])
    sys.stdout.write("\n" + json.dumps(result) + "\n")
