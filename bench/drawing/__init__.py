"""How a figure, a table and a page are made: matplotlib, SVG, LaTeX, Jinja."""
