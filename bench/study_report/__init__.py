"""A study's page, figures, answers.json, and the gallery."""
