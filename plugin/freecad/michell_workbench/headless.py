"""Scripts without a window: FreeCAD's own command line ends with code 0 whatever happens, this one does not."""

import os
import sys
import traceback
from collections.abc import Callable

from michell_workbench.bodies import FacesGone
from michell_workbench.client import WorkerError
from michell_workbench.session import close


def run(script: Callable[[], None]) -> None:
    """Run a function and end FreeCAD: code 0, or 1 with one readable message on standard error."""
    code, told = 1, False
    try:
        script()
        code = 0
    except (WorkerError, FacesGone, ValueError) as error:
        told = True
        sys.stderr.write(f"michell_cad: {error}\n")
    finally:
        if code and not told:
            traceback.print_exc()
        close()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)  # freecadcmd would run the script once more, and end with 0
