"""The example of a server, run step by step where no container engine is, and used by many."""
