"""Conversion of camera channels to colour."""
