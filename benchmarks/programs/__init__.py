"""The measured programs: each solves one problem in a process of its own."""
