"""Tables of numbers and text, as CSV files hold them."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, Dict, Iterator, List, Sequence, Union

import numpy as np

#: Value of a field: a number, text, or ``None`` where nothing was measured.
Value = Union[int, float, str, None]

#: Integers are read as such below this, which NumPy and pandas can store.
_LIMIT = 2**63


class Table:
    """Rows with named columns.

    Attributes:
        columns: Names of the columns in order.
        rows: One dictionary for each row.
    """

    def __init__(self, columns: Sequence[str], rows: Sequence[Dict[str, Value]]) -> None:
        self.columns: List[str] = list(columns)
        self.rows: List[Dict[str, Value]] = list(rows)

    @classmethod
    def read(cls, path: Union[str, Path]) -> "Table":
        """Reads a CSV file with a header. A column whose fields are all numbers or empty has
        numbers, and integers if all are whole; an empty field is ``None``."""
        with open(path, newline="", encoding="utf-8") as file:
            # An apostrophe marks text that spreadsheets would take for a formula.
            lines = [[field.removeprefix("'") for field in line] for line in csv.reader(file)]
        header, fields = (lines[0], lines[1:]) if lines else ([], [])
        columns = [_values([line[index] for line in fields]) for index in range(len(header))]
        rows = [dict(zip(header, row)) for row in zip(*columns)]
        return cls(header, rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Dict[str, Value]]:
        return iter(self.rows)

    def __getitem__(self, index: int) -> Dict[str, Value]:
        return self.rows[index]

    def __repr__(self) -> str:
        return f"<Table of {len(self.rows)} rows: {', '.join(self.columns)}>"

    def column(self, name: str) -> "np.ndarray":
        """Returns a column as an array: of ``float64``, with NaN where nothing was measured, or of
        objects if it has text.

        Raises:
            KeyError: There is no such column.
        """
        if name not in self.columns:
            raise KeyError(f"no column `{name}`; there are {', '.join(self.columns)}")
        values = [row[name] for row in self.rows]
        if any(isinstance(value, str) for value in values):
            return np.array(values, dtype=object)
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    def where(self, **values: Any) -> "Table":
        """Returns the rows in which the columns have these values."""
        rows = [row for row in self.rows if all(row.get(key) == v for key, v in values.items())]
        return Table(self.columns, rows)

    def to_pandas(self) -> Any:
        """Returns a ``pandas.DataFrame``; pandas has to be installed. Columns of integers are
        ``int64``, or the nullable ``Int64`` if a field is empty."""
        import pandas

        frame = pandas.DataFrame(self.rows, columns=self.columns)
        for name in self.columns:
            values = [row[name] for row in self.rows if row[name] is not None]
            if values and all(isinstance(value, int) for value in values):
                frame[name] = frame[name].astype("int64" if len(values) == len(self) else "Int64")
        return frame

    def _repr_html_(self) -> str:
        def cell(value: Value) -> str:
            text = "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
            return text.replace("&", "&amp;").replace("<", "&lt;")

        head = "".join(f"<th>{cell(name)}</th>" for name in self.columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{cell(row[name])}</td>" for name in self.columns) + "</tr>"
            for row in self.rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _values(texts: Sequence[str]) -> List[Value]:
    """Returns the values of a column: integers, numbers or text, and ``None`` for empty fields."""
    try:
        whole = [int(text) if text else None for text in texts]
        if all(value is None or abs(value) < _LIMIT for value in whole):
            return list(whole)
    except ValueError:
        pass
    try:
        return [float(text) if text else None for text in texts]
    except ValueError:
        return [text or None for text in texts]
