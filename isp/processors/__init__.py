"""Every way to make a picture from a raw file."""

from isp.processors.catalogue import PROCESSORS

__all__ = ["PROCESSORS"]
