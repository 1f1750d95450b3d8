"""Rows of a history as columns."""


def as_columns(row):
    """Return the columns of one row, as `History.extend` takes them."""
    return {name: [value] for name, value in row.items()}
