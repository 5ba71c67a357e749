"""A posed body drawn onto silhouettes, of one camera or several."""
