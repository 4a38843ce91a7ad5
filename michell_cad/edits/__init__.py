"""Editing a finished structure by family and by curve (Arora et al. 2019, Section 6): selections, edits, edit lists."""

from michell_cad.edits.adding import AddCurve, AddStrut
from michell_cad.edits.attachments import Attach, Frames, attachment_frames
from michell_cad.edits.edit_list import NO_EDITS, EditList, EditScript, change_knobs, read_script, write_script
from michell_cad.edits.joining import Join
from michell_cad.edits.removing import Remove, RemoveOpenEnds, Thin
from michell_cad.edits.script_schema import script_schema
from michell_cad.edits.selections import (
    Box,
    Every,
    Everything,
    Family,
    InSolid,
    Label,
    Length,
    Near,
    Part,
    Selection,
    Where,
)
from michell_cad.edits.sentences import selection_from
from michell_cad.edits.sheets import AddSheet, build_sheets
from michell_cad.edits.sizing import Entasis, Radius, resize_structure, size_structure
from michell_cad.edits.snapping import Snap
from michell_cad.edits.structure import DesignFields, Edit, Structure
from michell_cad.edits.tagging import Tag, tagged_members

__all__ = [
    "NO_EDITS",
    "AddCurve",
    "AddSheet",
    "AddStrut",
    "Attach",
    "Box",
    "DesignFields",
    "Edit",
    "EditList",
    "EditScript",
    "Entasis",
    "Every",
    "Everything",
    "Family",
    "Frames",
    "InSolid",
    "Join",
    "Label",
    "Length",
    "Near",
    "Part",
    "Radius",
    "Remove",
    "RemoveOpenEnds",
    "Selection",
    "Snap",
    "Structure",
    "Tag",
    "Thin",
    "Where",
    "attachment_frames",
    "build_sheets",
    "change_knobs",
    "read_script",
    "resize_structure",
    "script_schema",
    "selection_from",
    "size_structure",
    "tagged_members",
    "write_script",
]
