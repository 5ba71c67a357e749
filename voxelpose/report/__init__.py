"""report.html: one page that says what was found, how well, and what to do about the rest."""
