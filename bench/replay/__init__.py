"""A recorded cell driven once more, as page, film or recording."""
