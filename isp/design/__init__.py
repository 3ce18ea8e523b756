"""Closed forms of what a mosaic can tell: arrays in, arrays out; no sensor, light or exposure is known here."""
