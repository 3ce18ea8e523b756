"""Speed against error: what ``rodcone bench`` measures."""
