"""Makes figures, tables and pages: matplotlib, SVG, LaTeX, Jinja."""
