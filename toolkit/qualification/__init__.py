"""The software's own qualification: certified sets, published examples and golden vectors, all packaged."""
