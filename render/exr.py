"""Name that written code imports: `render.radiance_files.exr` under its earlier path."""

from render.radiance_files.exr import read_exr, write_exr

__all__ = ["read_exr", "write_exr"]
