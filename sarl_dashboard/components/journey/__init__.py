"""What leads through the pages: the name at the top, the first run, the step that follows."""
