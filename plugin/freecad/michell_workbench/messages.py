"""What the dialogs say when something is in the way: what is wrong, and what to do about it."""

from michell_workbench.texts import translate

INSTALL = 'python3 -m venv michell && michell/bin/pip install "michell_cad @ FOLDER-OR-ADDRESS-OF-michell_cad"'
"""How the package gets into a Python of its own."""


def not_installed(python: str, said: str = "") -> str:
    """No Python with michell_cad was found."""
    text = translate(
        "MichellCAD",
        "The program michell_cad, which computes the truss, was not found.\n\n"
        "Tried: {python}\n{said}\n"
        "Install it once, in a Python (3.11 or newer) of its own:\n    {install}\n"
        "then name that Python (here: michell/bin/python) under Edit > Preferences > Michell, or run\n"
        "    michell-cad plugin install freecad\n"
        "which does so for you.",
    )
    return text.format(python=python, said=said, install=INSTALL)


def worker_died(code: int | None, said: str = "") -> str:
    """The worker process ended while it was wanted."""
    text = translate(
        "MichellCAD",
        "The computation stopped unexpectedly (exit code {code}). Nothing in the document was changed.\n\n"
        "Try again; if it stops again, memory may be short: choose a smaller resolution or a larger mesh size.\n{said}",
    )
    return text.format(code=code, said=said).rstrip()


def cancelled() -> str:
    """The designer did not want to wait."""
    return translate("MichellCAD", "Cancelled. The document is as it was.")


def busy() -> str:
    """A second request while the first one runs."""
    return translate("MichellCAD", "michell_cad is still computing another truss: wait until it is done, or cancel it.")


def faces_gone(body: str, places: list[str]) -> str:
    """Picked faces are no longer on the body."""
    text = translate(
        "MichellCAD",
        "The body {body} has been edited, and these faces are no longer there:\n{places}\n\n"
        "Open the truss (double click), pick the faces again, and compute.",
    )
    return text.format(body=body, places="\n".join(f"    {place}" for place in places))


def body_changed(body: str) -> str:
    """The body is not the one that the truss was designed for."""
    text = translate(
        "MichellCAD",
        "The body {body} has changed since this truss was computed. Double click on the truss and compute again.",
    )
    return text.format(body=body)


def body_gone() -> str:
    """The truss has no body (any more)."""
    return translate(
        "MichellCAD",
        "The body of this truss is no longer in the document. Its knobs still work; to compute it again, make a new "
        "truss from another body.",
    )


def no_design() -> str:
    """The design inside the document is missing."""
    return translate(
        "MichellCAD",
        "The design of this truss is not in the document (it is stored inside the .FCStd file when the document is "
        "saved). Double click on the truss and compute again.",
    )


def newer_document(found: int, known: int) -> str:
    """The document was saved by a newer add-in."""
    text = translate(
        "MichellCAD",
        "This truss was saved by a newer add-in (version {found}; this one reads up to {known}). Its shape stays as it "
        "is. To change it, install a newer michell_cad and run: michell-cad plugin install freecad",
    )
    return text.format(found=found, known=known)


def unsaved_document(name: str) -> str:
    """The document has no file yet."""
    text = translate(
        "MichellCAD",
        "The document {name} has not been saved yet. Save it to keep the truss: its design is stored inside the "
        "document, so that the knobs work without computing again.",
    )
    return text.format(name=name)


def nothing_picked(what: str) -> str:
    """No faces are selected in the 3-D view."""
    text = translate(
        "MichellCAD", "Select one or more faces of the body in the 3-D view first, then press the button for {what}."
    )
    return text.format(what=what)


def two_bodies(first: str, second: str) -> str:
    """Faces of more than one body."""
    text = translate(
        "MichellCAD", "The faces belong to {first} and to {second}: a truss is made of one body. Pick faces of {first}."
    )
    return text.format(first=first, second=second)


def incomplete(missing: list[str]) -> str:
    """What is still to be picked before computing."""
    text = translate("MichellCAD", "Before computing, give: {missing}.")
    return text.format(missing=", ".join(missing))


def not_a_solid(body: str, solids: int) -> str:
    """The body is not one solid."""
    text = translate(
        "MichellCAD",
        "{body} holds {solids} solids; a truss is made of exactly one. Unite them (Part > Boolean > Union), or pick "
        "faces of a single solid.",
    )
    return text.format(body=body, solids=solids)


def not_a_truss() -> str:
    """A command needs a truss."""
    return translate("MichellCAD", "Select a Michell truss in the tree first.")
