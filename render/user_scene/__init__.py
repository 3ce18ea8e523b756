"""Mitsuba files of users' scenes, checked before anything in them is instantiated."""
