"""Spectral radiance as files: OpenEXR and ISETCam's ``.mat``."""
