"""What the paper's claims are measured by: from a study's table, numbers and words."""
