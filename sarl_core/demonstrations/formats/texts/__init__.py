"""Tables as text: CSV and TSV, JSON, and the sheets of Excel."""
