"""Name that written code imports: `studies.photograph.develop` under its earlier path."""

from studies.photograph.develop import develop_file

__all__ = ["develop_file"]
