"""Studies of places: a case for each file."""
