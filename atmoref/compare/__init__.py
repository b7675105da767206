"""Two arrays and a budget make a verdict."""
