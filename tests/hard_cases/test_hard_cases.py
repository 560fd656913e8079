"""Every hard case has the outcome that physics demands; benchmarks/hard_cases.py prints them."""

import pytest

from tests.hard_cases.cases import CASES, tested
from tests.hard_cases.outcome import Case


def _marked(case: Case) -> object:
    marks = [pytest.mark.long] if case.long else []
    if case.unsolved:
        marks.append(pytest.mark.xfail(strict=True, reason=case.unsolved))
    return pytest.param(case, id=case.name, marks=marks)


@pytest.mark.parametrize("case", [_marked(case) for case in CASES])
def test_hard_case(case: Case) -> None:
    if not case.supported:
        pytest.skip("not supported yet: it needs balls that can lie still")
    outcome = case.outcome()
    assert outcome.ok, outcome.said


def test_no_two_cases_have_one_name() -> None:
    names = [case.name for case in (*CASES, *tested.CASES)]
    assert len(set(names)) == len(names)
