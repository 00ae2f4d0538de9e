"""What a person says of the columns of a table, and what is shown to one who has to."""
