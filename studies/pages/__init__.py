"""Results as HTML, SVG and Markdown. No physics."""
