"""One photograph: exposed, developed, written."""
