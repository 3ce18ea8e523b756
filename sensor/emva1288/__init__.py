"""A chip on the bench: EMVA Standard 1288."""
