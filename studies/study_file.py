"""Name that written code imports: `studies.study.study_file` under its earlier path."""

from studies.study.study_file import read_study

__all__ = ["read_study"]
