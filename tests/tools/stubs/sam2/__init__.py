"""Stands in for SAM 2."""
