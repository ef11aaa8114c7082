"""Helpers that know nothing of hair."""
