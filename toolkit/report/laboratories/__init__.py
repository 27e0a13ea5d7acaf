"""An interlaboratory comparison as a document: its vocabulary, texts, tables and figures."""
