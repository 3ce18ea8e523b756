"""Lamps within bands: several as one, and the error that is left."""
