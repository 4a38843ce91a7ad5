"""The global parametrization: from frames to three coordinates whose isocurves follow the stress.

Arora et al. 2019, Section 4.3 (doi:10.1145/3328939.3328999). Three steps, one file each: the linear least-squares
integration of the frames (`equation_11`), the removal of folds (`fold_barrier`), and, past the paper, the alignment of
the curves themselves (`stress_following`).
"""

from michell_cad.parametrization.parametrize import Layers, Parametrization, ParametrizationOptions, parametrize
from michell_cad.parametrization.quality import count_double_wound_edges

__all__ = ["Layers", "Parametrization", "ParametrizationOptions", "count_double_wound_edges", "parametrize"]
