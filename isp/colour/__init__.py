"""From camera channels to colour."""
