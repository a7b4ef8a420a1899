"""Tracks of what moves, measured on simulated streets, whose truth is known, and a real drive."""
