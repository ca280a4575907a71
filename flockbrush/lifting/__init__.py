"""Flights in space from one camera."""
