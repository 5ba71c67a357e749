"""From a picture to a silhouette, and from a posed body to its picture."""
