"""Isocurves of a parametrization as a network of labelled curves."""

from michell_cad.isocurves.network import CurveNetwork
from michell_cad.isocurves.trace import IsocurveOptions, trace_isocurves

__all__ = ["CurveNetwork", "IsocurveOptions", "trace_isocurves"]
