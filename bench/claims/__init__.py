"""A claim held against the store's numbers: it holds, fails or is open, with a sentence."""
