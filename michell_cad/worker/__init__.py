"""A process that stays and designs, builds and exports for a host program whose Python is not ours.

`python -m michell_cad.worker` reads one request per line from standard input and writes one event per line to standard
output, both JSON; what libraries print goes to standard error. Requests are done one after the other.

Every request has an `id` (a number) and says what to `do`:

===========  ======================================  ==================================================================
do           other keys                              result
===========  ======================================  ==================================================================
``hello``    protocol                                version, the schema of the knobs, names of materials and stages
``design``   job, design                             runs a job file up to its truss and writes the design file
``build``    design, knobs, folder, families         writes the solid as ``truss.brep``; figures, family of every face;
                                                     with ``families`` also one BREP of the faces of each family
``export``   design, knobs, file                     writes ``.step`` (named, coloured faces) or ``.stl``
``cancel``   of                                      none; the request with the id ``of`` ends with an error "cancelled"
===========  ======================================  ==================================================================

Events: ``{"id", "event": "progress", "stage", "fraction"}``, and at the end of a request either ``{"id", "event":
"done", "result"}`` or ``{"id", "event": "error", "kind", "message"}`` with the kind ``input`` (the input has to
change), ``failed``, ``cancelled``, ``protocol`` (the request is none) or ``bug``.

Files appear whole or not at all. The worker holds nothing that is not in a file, so that a host may kill it at any time
and start another; to cancel it asks first, and kills when no answer comes. When its input ends the worker cancels what
it is doing and ends, too.
"""

PROTOCOL = 1
"""Version of the requests and events; it grows when a host of today would misunderstand them."""
