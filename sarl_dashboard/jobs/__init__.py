"""Long work: run, told of, cancelled, its result kept."""
