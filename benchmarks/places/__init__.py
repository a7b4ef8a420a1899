"""Places: measurements of what is found in maps of one place."""
