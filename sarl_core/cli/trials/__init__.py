"""Commands that try an agent in an environment, shielded or not."""
