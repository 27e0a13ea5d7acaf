"""A plan's sheet as a document: its vocabulary, texts, tables and figures; one template serves all plans."""
