"""Reports as flat rows, for pandas, polars and Arrow."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from . import _slipbound as _native

if TYPE_CHECKING:
    import pandas

    from ._slipbound import Report

Value = bool | int | float | str | None


@cache
def _template() -> dict[str, Any]:
    template: dict[str, Any] = json.loads(_native.full_line())
    return template


def _put(row: dict[str, Value], key: str, value: Any, template: Any) -> None:
    prefix = f"{key}_" if key else ""
    if isinstance(template, dict):
        parts = cast("dict[str, Any]", template)
        for name, part in parts.items():
            _put(row, prefix + name, None if value is None else value.get(name), part)
    elif isinstance(template, list):
        for i, name in enumerate(("x", "y")):
            _put(row, prefix + name, None if value is None else value[i], template[i])
    else:
        # JSON writes a whole number without a fraction; a column has one type.
        row[key] = float(value) if isinstance(template, float) and value is not None else value


def flat(line: dict[str, Any]) -> dict[str, Value]:
    """Flatten a report's dict: every report has every column, of one type, None where it is unknown."""
    row: dict[str, Value] = {}
    _put(row, "", line, _template())
    return row


def rows(reports: Iterable[Report]) -> list[dict[str, Value]]:
    """Flatten reports to rows of equal columns.

    For ``pyarrow.Table.from_pylist(rows)`` or ``polars.DataFrame(rows, infer_schema_length=None)``: by itself polars looks
    at the first 100 rows only, and at rest most of their values are None.

    Parameters
    ----------
    reports : iterable of Report
        Reports of one or several fingers.

    Returns
    -------
    list of dict
        Keys are those of the JSON report joined by ``_``: ``contact_area_px2``, ``margin_value``,
        ``motion_translation_px_x``; an unknown value is None, and so is what was not measured, as in a torn frame.
    """
    return [report.to_row() for report in reports]


def to_pandas(reports: Iterable[Report]) -> pandas.DataFrame:
    """Put reports into a table, one row per report; see :func:`rows`. Needs pandas.

    Parameters
    ----------
    reports : iterable of Report
        Reports of one or several fingers.

    Returns
    -------
    pandas.DataFrame
        Whole numbers are ``Int64``, so that a time in ns stays exact where another row has none; ``UInt64`` in a column
        with one above 2^63 - 1.
    """
    import pandas

    def column(values: list[Value], template: Value) -> pandas.Series[Any]:
        most = max((value for value in values if isinstance(value, int)), default=0)
        whole = "Int64" if most < 1 << 63 else "UInt64"
        return pandas.Series(values, dtype=whole if type(template) is int else None)

    table = rows(reports)
    columns = {name: column([row[name] for row in table], value) for name, value in flat(_template()).items()}
    return pandas.DataFrame(columns)
