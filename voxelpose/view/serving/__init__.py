"""Who may see a page: a gate before its server."""
