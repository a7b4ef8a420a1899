"""Mutation fuzzers over every reader, the binding and sessions; `./run fuzz` runs them."""
