"""A golden record: what the command line makes and says, to prove that a refactoring changes neither."""
