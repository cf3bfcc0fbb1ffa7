"""The last word of a file: messages found against those that the file itself declares."""

from __future__ import annotations

import pytest

from mclcli.io.logs.report import Report


@pytest.mark.parametrize(("found", "declared", "missing"), [(3, 5, 2), (0, 1, 1), (5, 3, None), (1, 0, None)])
def test_a_whole_file_with_other_totals_is_damaged(found: int, declared: int, missing: int | None) -> None:
    (damage,) = Report("x").totals(9, found, declared, "the index counts")
    assert (damage.offset, damage.messages, damage.lossless) == (9, missing, False)
    assert damage.what == f"the index counts {declared} messages, but {found} were found"


def test_totals_that_agree_say_nothing() -> None:
    assert list(Report("x").totals(9, 5, 5, "the index counts")) == []


@pytest.mark.parametrize(("declared", "more"), [(5, None), (7, None), (8, 1), (12, 5)])
def test_what_was_said_to_be_lost_counts(declared: int, more: int | None) -> None:
    """5 found, 2 said to be lost."""
    report = Report("x")
    report.lost(3, "chunk fails its checksum", 2)
    assert [damage.messages for damage in report.totals(9, 5, declared, "the index counts")] == ([more] if more else [])


def test_totals_settle_damages_that_could_not_tell_how_many() -> None:
    report = Report("x")
    report.lost(3, "chunk fails its checksum", 2)
    report.lost(4, "broken framing")
    (settled,) = report.totals(9, 5, 7, "the index counts")
    assert (settled.lossless, settled.in_all) == (True, True)
    (more,) = report.totals(9, 5, 9, "the index counts")
    assert (more.messages, more.in_all) == (2, True)


def test_least_totals_settle_nothing() -> None:
    report = Report("x")
    report.lost(4, "broken framing")
    assert list(report.totals(9, 5, 5, "the index counts", least=True)) == []
    (more,) = report.totals(9, 5, 6, "the index counts", least=True)
    assert not more.in_all
