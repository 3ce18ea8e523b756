"""Scenes from outside: Mitsuba files, checked before anything in them is instantiated."""
