"""A real camera beside its twin: a preset measured from frames, and the same frames taken with it."""
