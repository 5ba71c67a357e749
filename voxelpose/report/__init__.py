"""report.html: results, their quality and advice on one page."""
