"""A comparison as a document: its vocabulary, tables, figures and default template."""
