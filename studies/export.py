"""Name that written code imports: `studies.sweep.export` under its earlier path."""

from studies.sweep.export import read_rows, to_pandas

__all__ = ["read_rows", "to_pandas"]
