"""Studies: their files, their scenes and their models."""
