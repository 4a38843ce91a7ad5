"""The errors of the package: few classes, each message says what was expected, what was found and what to do."""


class MichellError(Exception):
    """Base of all errors that this package raises on purpose."""


class InvalidInputError(MichellError, ValueError):
    """An input is not what it has to be: a file, a key, a selector, an array."""


class ConvergenceError(MichellError, RuntimeError):
    """An iterative stage ended without reaching its stated tolerance."""


class GeometryKernelError(MichellError, RuntimeError):
    """The CAD kernel returned a shape that fails the package's own checks."""
