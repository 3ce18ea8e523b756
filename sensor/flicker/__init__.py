"""Lamps that flicker, and rows that are exposed one after another."""
