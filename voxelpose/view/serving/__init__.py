"""Who may see a page: viser's server behind a gate."""
