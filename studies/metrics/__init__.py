"""How far a picture is from the truth."""
