"""Read and check study files: the design, varied parameters, objective, constraints, budget."""

from chamberopt.search.study.constraints import Limits
from chamberopt.search.study.load import load, load_study
from chamberopt.search.study.schema import Objective, Study

__all__ = ["Limits", "Objective", "Study", "load", "load_study"]
