"""Tables in eighty columns: numbers and headings whole, words on several lines."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from ertskin.terminal_table import Column, Row, print_table

LONG = "contacts (with sheet_inhomogeneity, piezo_hysteresis)"


def printed(width: int, columns: list[Column], rows: list[Row], caption: str = "") -> str:
    stream = io.StringIO()
    print_table(Console(file=stream, width=width), columns, rows, caption)
    return stream.getvalue()


def columns(numbers: int) -> list[Column]:
    return [Column("method", words=True), *(Column(f"metric {k}\n%") for k in range(numbers))]


def rows(numbers: int) -> list[Row]:
    return [Row((name, *(f"{10 + k}.{k}±0.1" for k in range(numbers)))) for name in (LONG, "oracle")]


@pytest.mark.parametrize("numbers", [1, 5, 12])
@pytest.mark.parametrize("width", [60, 80, 200])
def test_numbers_and_headings_are_whole(width: int, numbers: int) -> None:
    text = printed(width, columns(numbers), rows(numbers))
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    for k in range(numbers):
        assert text.split().count(f"{10 + k}.{k}±0.1") == 2
        assert text.count(f"metric {k} ") + text.count(f"metric {k}\n") == 1


def test_a_long_name_wraps_between_its_words_and_a_wide_terminal_holds_it_in_one_line() -> None:
    narrow = printed(60, columns(3), rows(3))
    assert LONG not in narrow
    assert set(LONG.split()) <= set(narrow.split())
    assert LONG in printed(200, columns(3), rows(3))


def test_numbers_without_room_follow_in_a_table_with_the_same_names() -> None:
    text = printed(80, columns(12), rows(12), caption="said once")
    assert text.split().count("oracle") == text.count("method") > 1
    assert text.count("said once") == 1


def test_a_word_longer_than_the_terminal_is_folded() -> None:
    text = printed(30, [Column("file", words=True), Column("size")], [Row(("x" * 70, "12345"))])
    assert max(map(len, text.splitlines())) <= 30
    assert text.count("x") == 70
    assert "12345" in text.split()


def test_brackets_of_a_name_are_no_markup() -> None:
    assert "[red]" in printed(80, [Column("name", words=True), Column("n")], [Row(("layers [red]", "1"))])
