"""What a study file says: design, what varies, what is maximised, what must hold, and budget."""

from chamberopt.search.study.constraints import Limits
from chamberopt.search.study.load import load, load_study
from chamberopt.search.study.schema import Objective, Study

__all__ = ["Limits", "Objective", "Study", "load", "load_study"]
