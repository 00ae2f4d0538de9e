"""What rules are worth in states that they were not mined from."""
