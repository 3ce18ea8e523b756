"""Raw images as files: DNG, TIFF, raws of real cameras."""

from sensor.raw_files.raw_file import open_raw

__all__ = ["open_raw"]
