"""Every cell of a study: made, stored, exported."""
