"""Name that written code imports: `studies.photograph.picture_file` under its earlier path."""

from studies.photograph.picture_file import write_picture

__all__ = ["write_picture"]
