"""Closed forms of a mosaic's expected error, as functions of arrays without any sensor, light or exposure."""
